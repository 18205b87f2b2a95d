#!/usr/bin/env bash
# movingpandas 0.23.0: where a ship was depends on whether one asks for it or for all ships.
#
# Expected: `get_locations_at` of a collection gives the places that `get_position_at` gives of each ship.
# Seen: the ship's is interpolated, the collection's is the nearest fix, stamped with that fix's time. With fixes
# ten minutes apart it lies kilometres off, and two ships' places are of different moments.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
  movingpandas==0.23.0 geopandas==1.2.0 pandas==3.1.1 shapely==2.2.0
cd "$folder"
cat > run.py <<'PY'
import warnings
from datetime import datetime

warnings.simplefilter("ignore")
import movingpandas as mpd
import pandas as pd

times = ["00:00", "00:10", "00:03", "00:13"]
fixes = pd.DataFrame({"t": pd.to_datetime([f"2024-01-01 {time}" for time in times])})
fixes["ship"], fixes["x"], fixes["y"] = [1, 1, 2, 2], [10.0, 10.1, 11.0, 11.1], 55.0
ships = mpd.TrajectoryCollection(fixes, "ship", t="t", x="x", y="y", crs=4326)
moment = datetime(2024, 1, 1, 0, 6)
for ship in ships:
    print("ship", ship.id, round(ship.get_position_at(moment).x, 3))
for _, row in ships.get_locations_at(moment).iterrows():
    print("all: ship", row.ship, round(row.geometry.x, 3), f"{row.t:%H:%M}")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
ship 1 10.06
ship 2 11.03
all: ship 1 10.1 00:10
all: ship 2 11.0 00:03
EXPECTED
echo "as described"
