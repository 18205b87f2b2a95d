#!/usr/bin/env bash
# gpxpy 1.6.2: `get_location_at` gives the next point, not the place at that time.
#
# Expected: the place between the two points, or the nearer one.
# Seen: the point after it. A minute after a point, with points ten minutes apart, it is 5.7 km off.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet gpxpy==1.6.2
cd "$folder"
cat > run.py <<'PY'
from datetime import datetime, timedelta, timezone

from gpxpy.gpx import GPXTrackPoint, GPXTrackSegment

start = datetime(2024, 1, 1, tzinfo=timezone.utc)
points = [GPXTrackPoint(55.0, 10.0 + 0.1 * n, time=start + timedelta(minutes=10 * n)) for n in range(3)]
segment = GPXTrackSegment(points)
for minutes in (0, 1, 9, 11):
    found = segment.get_location_at(start + timedelta(minutes=minutes))
    there = GPXTrackPoint(55.0, 10.0 + 0.01 * minutes)
    print(minutes, "min:", found.longitude, f"{found.distance_2d(there):.0f} m off")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
0 min: 10.0 0 m off
1 min: 10.1 5747 m off
9 min: 10.1 639 m off
11 min: 10.2 5747 m off
EXPECTED
echo "as described"
