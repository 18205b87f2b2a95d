#!/usr/bin/env bash
# pynmea2 1.19.0: a receiver without a fix is at 0 N 0 E.
#
# Expected: a sentence whose status is V (void) and whose position fields are empty has no latitude; the speed and
# the course of the same sentence are None.
# Seen: speed and course are None, latitude and longitude are the number 0.0. A track from a ship's own receiver
# jumps to the Gulf of Guinea wherever the fix is lost. In one VTG sentence, knots are a Decimal and kilometres an
# hour a float; the rate of turn of ROT stays text. pynmeagps 1.1.8 gives an empty string for each of these fields.
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


void = sentence("GPRMC,120000.00,V,,,,,,,271126,,,N")
fix = pynmea2.parse(void)
print("pynmea2", fix.status, repr(fix.latitude), repr(fix.longitude), fix.spd_over_grnd, fix.true_course)
other = NMEAReader.parse(void)
print("pynmeagps", other.status, repr(other.lat), repr(other.lon), repr(other.spd), repr(other.cog))
vtg = pynmea2.parse(sentence("GPVTG,045.0,T,,M,12.3,N,22.8,K"))
print("VTG", type(vtg.spd_over_grnd_kts).__name__, type(vtg.spd_over_grnd_kmph).__name__)
print("ROT", repr(pynmea2.parse(sentence("HEROT,-12.5,A")).rate_of_turn))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
pynmea2 V 0.0 0.0 None None
pynmeagps V '' '' '' ''
VTG Decimal float
ROT '-12.5'
EXPECTED
echo "as described"
