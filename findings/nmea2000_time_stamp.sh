#!/usr/bin/env bash
# nmea2000 2026.10.3: an AIS position report has a time stamp where its second is not known, and none where it is.
#
# Expected: `value` of "Time Stamp" is the second for 0 to 59, and None for 60 (not available) and 63 (inoperative).
# Seen: None at 0, 12 and 59, a text at 60 and 63; the second is in `raw_value` alone. A filter that drops reports whose
# `value` is None keeps only the bad ones. A course without a value is None, as one expects. With `units="si"` it is in
# radians, while the latitude of the same message is in degrees.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet nmea2000==2026.10.3
cd "$folder"
cat > run.py <<'PY'
import struct

from nmea2000 import NMEA2000Decoder


def report(second: int, course: int) -> str:
    """Return a class A position report, PGN 129038, as a line of canboat's plain format."""
    place = struct.pack("<BIii", 1, 257000001, 101234567, 599000000) + bytes([second << 2])
    motion = struct.pack("<HH3xHh", course, 617, 15708, 1000) + b"\x0f\xff\xff"
    data = place + motion
    return f"2026-11-27T12:00:00.000Z,4,129038,43,255,{len(data)}," + ",".join(f"{one:02x}" for one in data)


decoder = NMEA2000Decoder(units="si")
for second in (0, 12, 59, 60, 63):
    fields = {field.id: field for field in decoder.decode(report(second, 15708)).fields}
    print(second, fields["timeStamp"].value, fields["timeStamp"].raw_value)
for course in (15708, 0xFFFF):
    fields = {field.id: field for field in decoder.decode(report(12, course)).fields}
    told = (fields[name] for name in ("cog", "latitude"))
    print(*(f"{field.value} {field.unit_of_measurement}" for field in told))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
0 None 0
12 None 12
59 None 59
60 Not available 60
63 Positioning system is inoperative 63
1.5708 rad 59.9 deg
None rad 59.9 deg
EXPECTED
echo "as described"
