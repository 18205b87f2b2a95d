#!/usr/bin/env bash
# pynmea2 1.19.0: the local time of ZDA is an hour off where the zone is negative and has a half hour.
#
# Expected: the minutes have the sign of the hours, as the class's own comment and makers' manuals say: -03,30 is three
# hours and a half behind.
# Seen: the minutes, which have no sign of their own in the sentence, are always added: -03,30 is two hours and a half
# behind. Where the hours are positive it is right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pynmea2==1.19.0
cd "$folder"
cat > run.py <<'PY'
from functools import reduce

import pynmea2

for zone in ("-03,00", "03,30", "-03,30", "-09,30", "-05,15"):
    body = f"GPZDA,120000.00,13,09,2026,{zone}"
    message = pynmea2.parse(f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}")
    print(zone, message.datetime.time(), message.localdatetime.isoformat())
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
-03,00 12:00:00 2026-09-13T09:00:00-03:00
03,30 12:00:00 2026-09-13T15:30:00+03:30
-03,30 12:00:00 2026-09-13T09:30:00-02:30
-09,30 12:00:00 2026-09-13T03:30:00-08:30
-05,15 12:00:00 2026-09-13T07:15:00-04:45
EXPECTED
echo "as described"
