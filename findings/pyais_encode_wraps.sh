#!/usr/bin/env bash
# pyais 3.3.1: a number that does not fit its field is sent as another one.
#
# Expected: an error, or the largest value, or "not available"; above all for message 27, whose speed ends at 62
# knots while "not available" is 102.3 in message 1 and 63 here.
# Seen: the number modulo 64. A copied "not available" becomes 38 knots; a course of -5 degrees becomes 404.6.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import decode, encode_dict

ship = {"mmsi": 219000001, "lat": 55.0, "lon": 10.0}
for kind, values in ((27, {"speed": 70}), (27, {"speed": 102.3}), (1, {"course": -5.0})):
    report = decode(*encode_dict({"msg_type": kind, **ship, **values}))
    ((name, given),) = values.items()
    print(f"message {kind}: {name} {given} becomes {getattr(report, name)}")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
message 27: speed 70 becomes 6.0
message 27: speed 102.3 becomes 38.0
message 1: course -5.0 becomes 404.6
EXPECTED
echo "as described"
