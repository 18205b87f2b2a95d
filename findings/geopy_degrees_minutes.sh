#!/usr/bin/env bash
# geopy 2.5.0: a position in degrees and minutes is read as that of another sea.
#
# Expected: `Point` reads the minutes, or says "unknown format" as it does of 59-30.5N 010-20.5E.
# Seen: without a mark behind the minutes, 59 30.5 N 10 20.5 E is 10 N 20.5 E: all before the last two numbers is
# skipped. A degree sign does not help. In the documentation minutes have a mark; nothing says that they need one. The
# minus of -0 is lost even with a mark, so that 20 minutes west of Greenwich become 20 minutes east of it, while -1 20m
# is right. lat-lon-parser 1.3.1 reads all of them (with ' for m).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet geopy==2.5.0 lat-lon-parser==1.3.1
cd "$folder"
cat > run.py <<'PY'
from geopy import Point
from lat_lon_parser import parse

for latitude, longitude in (
    ("59 30.5' N", "10 20.5' E"),
    ("59 30.5 N", "10 20.5 E"),
    ("59° 30.5 N", "010° 20.5 E"),
    ("59 30 30 S", "10 20 30 W"),
    ("50 30m", "-1 20m"),
    ("50 30m", "-0 20m"),
):
    point = Point(f"{latitude}, {longitude}")
    other = [parse(text.replace("m", "'")) for text in (latitude, longitude)]
    print(f"{latitude}, {longitude}: {point.latitude:.3f} {point.longitude:.3f}, lat-lon-parser", end=" ")
    print(*(f"{number:.3f}" for number in other))
try:
    Point("59-30.5N 010-20.5E")
except ValueError as error:
    print(error)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
59 30.5' N, 10 20.5' E: 59.508 10.342, lat-lon-parser 59.508 10.342
59 30.5 N, 10 20.5 E: 10.000 20.500, lat-lon-parser 59.508 10.342
59° 30.5 N, 010° 20.5 E: 10.000 20.500, lat-lon-parser 59.508 10.342
59 30 30 S, 10 20 30 W: 20.000 -30.000, lat-lon-parser -59.508 -10.342
50 30m, -1 20m: 50.500 -1.333, lat-lon-parser 50.500 -1.333
50 30m, -0 20m: 50.500 0.333, lat-lon-parser 50.500 -0.333
Failed to create Point instance from string: unknown format.
EXPECTED
echo "as described"
