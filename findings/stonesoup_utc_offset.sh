#!/usr/bin/env bash
# Stone Soup 1.9.1: of a time with an offset from UTC the offset is dropped.
#
# Expected: the CSV readers turn 12:00 at +02:00 into 10:00 UTC, or keep the time zone, so that a fix of 10:00:10 Z comes
# ten seconds later.
# Seen: 12:00 and 10:00:10 without a zone: two stations' fixes of one ship are two hours apart, in the wrong order.
# Unix times (timestamp=True) are UTC; with `time_field_format` and its %z the zone stays.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet stonesoup==1.9.1 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
from pathlib import Path

from stonesoup.reader.generic import CSVDetectionReader

FILES = {
    "text": "time,lon,lat\n2026-01-01T12:00:00+02:00,5.30,60.40\n2026-01-01T10:00:10Z,5.31,60.41\n",
    "unix": "time,lon,lat\n1767261600,5.30,60.40\n1767261610,5.31,60.41\n",
}
for name, text in (*FILES.items(), ("format", FILES["text"])):
    Path(name).write_text(text)
    fields = {"state_vector_fields": ("lon", "lat"), "time_field": "time", "timestamp": name == "unix"}
    if name == "format":
        fields["time_field_format"] = "%Y-%m-%dT%H:%M:%S%z"
    for time, _ in CSVDetectionReader(name, **fields):
        print(name, time, time.tzinfo)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
text 2026-01-01 12:00:00 None
text 2026-01-01 10:00:10 None
unix 2026-01-01 10:00:00 None
unix 2026-01-01 10:00:10 None
format 2026-01-01 12:00:00+02:00 UTC+02:00
format 2026-01-01 10:00:10+00:00 UTC
EXPECTED
echo "as described"
