#!/usr/bin/env bash
# pynmeagps 1.1.8: radar targets west of Greenwich are east of it, those south of the equator north of it.
#
# Expected: in TLL, the sentence of a tracked target's position, south and west are negative, as in RMC, GLL and WPL.
# Seen: own position at 37.86 S, 122.34 W has negative numbers; the target at the very
# same place has positive ones. The letters of the hemispheres stand in fields of their own, `targetlatNS` and
# `targetlonEW`. The waypoint of BEC is wrong likewise. pynmea2 1.19.0 gives negative numbers for the same TLL.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pynmea2==1.19.0 pynmeagps==1.1.8
cd "$folder"
cat > run.py <<'PY'
from functools import reduce

import pynmea2
from pynmeagps import NMEAReader


def sentence(body: str) -> str:
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}"


place = "3751.65,S,12220.5678,W"
for body in (f"GPRMC,081836,A,{place},010.0,360.0,130926,,", f"GPGLL,{place},081836,A,A", f"GPWPL,{place},BUOY"):
    own = NMEAReader.parse(sentence(body))
    print(body[2:5], own.lat, own.lon)
tll = sentence(f"RATLL,01,{place},TGT,081836.00,T,")
target = NMEAReader.parse(tll)
print("TLL", target.targetlat, target.targetlatNS, target.targetlon, target.targetlonEW)
waypoint = NMEAReader.parse(sentence(f"GPBEC,081837,{place},052.4,T,031.0,M,000.5,N,BUOY"))
print("BEC", waypoint.wptlat, waypoint.wptlon)
other = pynmea2.parse(tll)
print("pynmea2", f"{other.latitude:.10f} {other.longitude:.10f}")
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
RMC -37.8608333333 -122.3427966667
GLL -37.8608333333 -122.3427966667
WPL -37.8608333333 -122.3427966667
TLL 37.8608333333 S 122.3427966667 W
BEC 37.8608333333 122.3427966667
pynmea2 -37.8608333333 -122.3427966667
EXPECTED
echo "as described"
