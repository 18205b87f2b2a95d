#!/usr/bin/env bash
# pyais 3.3.1: `NoneFilter` keeps every position report that has no position, speed, course or heading.
#
# Expected: `NoneFilter("lat", "lon", "speed", "course", "heading")` drops messages in which one is not available.
# Seen: it drops only messages of a kind without such a field. What is not available is a number (91, 181, 102.3,
# 360, 511), never None, so the report passes. `DistanceFilter` does the reverse: it drops that report as far
# away, and keeps a message of a kind without a position.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import IterMessages, encode_dict
from pyais.filter import DistanceFilter, FilterChain, NoneFilter

missing = {"lat": 91.0, "lon": 181.0, "speed": 102.3, "course": 360.0, "heading": 511}
known = {"lat": 56.0, "lon": 11.0, "speed": 12.0, "course": 90.0, "heading": 90}
messages = [
    {"msg_type": 1, "mmsi": 219000001, **known},
    {"msg_type": 1, "mmsi": 219000002, **missing},
    {"msg_type": 5, "mmsi": 219000003, "shipname": "NO POSITION"},
]
lines = [sentence.encode() for values in messages for sentence in encode_dict(values)]
for name, chain in (
    ("NoneFilter", FilterChain([NoneFilter(*missing)])),
    ("DistanceFilter", FilterChain([DistanceFilter((56.0, 11.0), distance_km=5)])),
):
    for message in chain.filter(IterMessages(lines)):
        print(name, message.mmsi, *(getattr(message, key, "-") for key in missing))
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
NoneFilter 219000001 56.0 11.0 12.0 90.0 90
NoneFilter 219000002 91.0 181.0 102.3 360.0 511
DistanceFilter 219000001 56.0 11.0 12.0 90.0 90
DistanceFilter 219000003 - - - - -
EXPECTED
echo "as described"
