#!/usr/bin/env bash
# pyais 3.3.1: `AISTracker` forgets each ship of a recorded file at once, and in milliseconds none ever.
#
# Expected: `update(message, ts_epoch_ms)` takes milliseconds, as its name says, and a ship is forgotten
# `ttl_in_seconds` (600) after the newest message; a late message is taken, as the class is said to handle them.
# Seen: the time is compared, in seconds, with the computer's clock. With the seconds of a recording no ship stays;
# with milliseconds one of an hour before stays. A late message of a ship that is known is a ValueError.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import AISTracker, decode, encode_dict


def report(number):
    values = {"msg_type": 1, "mmsi": 219000000 + number, "lat": 55.0, "lon": 10.0, "speed": 10.0}
    return decode(*encode_dict(values))


def ships(tracker):
    return [track.mmsi % 10 for track in tracker.tracks]


start = 1704067200
for word, factor in (("seconds", 1), ("milliseconds", 1000)):
    tracker = AISTracker()
    for number, seconds in ((1, 0), (2, 3600), (3, 3660)):
        tracker.update(report(number), (start + seconds) * factor)
        print(word, f"after {seconds} s:", ships(tracker))
tracker = AISTracker(ttl_in_seconds=None)
tracker.update(report(1), start)
tracker.update(report(2), start - 10)
print("late, another ship:", ships(tracker))
try:
    tracker.update(report(1), start - 10)
except ValueError as error:
    print("late, same ship:", error)
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
seconds after 0 s: []
seconds after 3600 s: []
seconds after 3660 s: []
milliseconds after 0 s: [1]
milliseconds after 3600 s: [1, 2]
milliseconds after 3660 s: [1, 2, 3]
late, another ship: [1, 2]
late, same ship: cannot update track with older message
EXPECTED
echo "as described"
