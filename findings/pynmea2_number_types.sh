#!/usr/bin/env bash
# pynmea2 1.19.0: the course is a float, the heading a Decimal and the rate of turn a text.
#
# Expected: numbers of one type, so that the drift angle is course minus heading.
# Seen: each sentence has its own: the subtraction is a TypeError, the speed in knots has two types, and rates of
# turn compare as text, in which "10.0" is below "9.0".
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pynmea2==1.19.0
cd "$folder"
cat > run.py <<'PY'
import pynmea2


def parse(text):
    total = 0
    for letter in text:
        total ^= ord(letter)
    return pynmea2.parse(f"${text}*{total:02X}")


rmc = parse("GPRMC,120000.00,A,5500.0000,N,01030.0000,E,10.5,045.0,150624,3.5,W,A")
vtg = parse("GPVTG,045.0,T,048.5,M,10.5,N,19.4,K,A")
heading = parse("HEHDT,040.0,T").heading
turns = [parse(f"TIROT,{rate},A").rate_of_turn for rate in ("9.0", "10.0")]
print("knots", repr(rmc.spd_over_grnd), repr(vtg.spd_over_grnd_kts))
print("course", repr(rmc.true_course), "heading", repr(heading), "largest turn", repr(max(turns)))
try:
    print(rmc.true_course - heading)
except TypeError as error:
    print(error)
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
knots 10.5 Decimal('10.5')
course 45.0 heading Decimal('40.0') largest turn '9.0'
unsupported operand type(s) for -: 'float' and 'decimal.Decimal'
EXPECTED
echo "as described"
