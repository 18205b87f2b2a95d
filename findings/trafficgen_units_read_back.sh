#!/usr/bin/env bash
# trafficgen 0.9.1: a situation that it reads back has other units than the one that it wrote.
#
# Expected: the same class holds the same units, whether generated or read by `read_generated_situation_files`.
# Seen: generated, radians and m/s; read, degrees and knots. Nothing in the object says which. (The folder must be
# absolute: of a relative one each file is looked for in out/out.)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet trafficgen==0.9.1
cd "$folder"
cat > run.py <<'PY'
import json
import logging
import random
from pathlib import Path

import trafficgen
from trafficgen.read_files import read_generated_situation_files
from trafficgen.ship_traffic_generator import generate_traffic_situations
from trafficgen.write_traffic_situation_to_file import write_traffic_situations_to_json_file

logging.disable(logging.WARNING)
ship = {"dimensions": {"length": 150.0, "width": 25.0}, "shipType": "Cargo", "sogMax": 20.0}
start = {"position": {"lat": 58.0, "lon": 10.0}, "sog": 10.0, "cog": 0.0, "heading": 0.0}
start["navStatus"] = "Under way using engine"
encounter = {"desiredEncounterType": "head-on", "vectorTime": 15.0}
wish = {"title": "one", "description": "", "ownShip": {"initial": start}, "encounters": [encounter]}
Path("targets").mkdir()
Path("out").mkdir()
Path("own.json").write_text(json.dumps({"id": 1, **ship}))
Path("targets/one.json").write_text(json.dumps({"id": 10, **ship}))
Path("wish.json").write_text(json.dumps(wish))
settings = Path(trafficgen.__file__).parent / "settings/encounter_settings.json"
random.seed(1)
made = generate_traffic_situations(Path("wish.json"), Path("own.json"), Path("targets"), settings)


def show(word, situation):
    first, second = situation.own_ship.waypoints[:2]
    values = (round(float(one), 4) for one in (first.position.lat, first.position.lon, second.leg.sog))
    print(word, type(situation).__name__, *values)


show("generated", made[0])
write_traffic_situations_to_json_file(made, Path("out"))
show("read back", read_generated_situation_files(Path("out").resolve())[0])
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
generated TrafficSituation 1.0123 0.1745 5.144
read back TrafficSituation 58.0 10.0 10.0
EXPECTED
echo "as described"
