#!/usr/bin/env bash
# pyais 3.3.1: places of messages 17, 22 and 23 are in minutes, and those of 17 have no south and west.
#
# Expected: `lat` and `lon` are degrees, negative in south and west, as in every position report of pyais and in aiscat.
# Seen: the corner of an area at 59.5 N, 10.5 W has 3570 and -630. A reference station at 59.5 S, 10.5 W has 9537.2 and
# 25584.4: its bits are read without a sign. `encode_dict` takes minutes as well: of 59.5 it makes a latitude of 0.992.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet aiscat==0.68.16 pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from functools import reduce

import aiscat
import pyais


def sentence(*fields: tuple[int, int]) -> str:
    """The fields (number, bits) as a sentence of one part."""
    bits = "".join(f"{number & (1 << size) - 1:0{size}b}" for number, size in fields)
    fill = -len(bits) % 6
    bits += "0" * fill
    sixes = [int(bits[at : at + 6], 2) for at in range(0, len(bits), 6)]
    body = "AIVDM,1,1,,A," + "".join(chr(six + (48 if six < 40 else 56)) for six in sixes) + f",{fill}"
    return f"!{body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}"


def place(longitude: float, latitude: float) -> tuple[tuple[int, int], ...]:
    return (round(longitude * 600), 18), (round(latitude * 600), 17)  # tenths of a minute


station = ((0, 2), (2570001, 30), (0, 2))
areas = place(-10.5, 59.5) + place(-11.5, 58.5)
messages = {
    17: ((17, 6), *station, *place(-10.5, -59.5), (0, 5), (0, 40)),
    22: ((22, 6), *station, (2087, 12), (2088, 12), (0, 5), *areas, (0, 3), (2, 3), (0, 23)),
    23: ((23, 6), *station, *areas, (0, 4), (0, 8), (0, 22), (0, 2), (9, 4), (0, 4), (0, 6)),
}
for number, fields in messages.items():
    text = sentence(*fields)
    for name, found in (("pyais", pyais.decode(text).asdict()), ("aiscat", dict(aiscat.decode(text)))):
        print(number, name, {key: found[key] for key in found if key.endswith(("lon", "lat"))})
report = pyais.encode_dict({"type": 1, "mmsi": "257000001", "lon": 10.5, "lat": 59.5})[0]
print("encoded 1", aiscat.decode(report)["lat"])
reference = pyais.encode_dict({"type": 17, "mmsi": "2570001", "lon": 10.5, "lat": 59.5, "data": bytes(5)})[0]
print("encoded 17", round(aiscat.decode(reference)["lat"], 3))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
17 pyais {'lon': 25584.4, 'lat': 9537.2}
17 aiscat {'lon': -10.5, 'lat': -59.5}
22 pyais {'ne_lon': -630.0, 'ne_lat': 3570.0, 'sw_lon': -690.0, 'sw_lat': 3510.0}
22 aiscat {'ne_lon': -10.5, 'ne_lat': 59.5, 'sw_lon': -11.5, 'sw_lat': 58.5}
23 pyais {'ne_lon': -630.0, 'ne_lat': 3570.0, 'sw_lon': -690.0, 'sw_lat': 3510.0}
23 aiscat {'ne_lon': -10.5, 'ne_lat': 59.5, 'sw_lon': -11.5, 'sw_lat': 58.5}
encoded 1 59.5
encoded 17 0.992
EXPECTED
echo "as described"
