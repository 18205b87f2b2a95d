#!/usr/bin/env bash
# pymap3d 3.2.0: the rhumb line across 180 degrees goes the other way round the world.
#
# Expected: `loxodrome_inverse` gives the steady course and the way of a ship from 59 N 179 E to 60 N 179 W: north-east,
# 159 km, as between 9 and 11 E.
# Seen: 20,276 km nearly due west where longitudes have a sign; nothing in the documentation excludes such places. With 181 for
# -179 it is right, and 181 is what `loxodrome_direct` gives on the way there.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pymap3d==3.2.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
from pymap3d.lox import loxodrome_direct, loxodrome_inverse
from pymap3d.vincenty import vdist

for here, there in ((9, 11), (179, -179), (179, 181), (-179, 179)):
    way, course = loxodrome_inverse(59, here, 60, there)
    other, _ = vdist(59, here, 60, there)
    print(f"{here} to {there}: {way / 1000:.0f} km on {course:.0f}, the shortest way is {other / 1000:.0f} km")
print("reached:", *(f"{number:.1f}" for number in loxodrome_direct(59, 179, 115_000, 90)))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
9 to 11: 159 km on 45, the shortest way is 159 km
179 to -179: 20276 km on 270, the shortest way is 159 km
179 to 181: 159 km on 45, the shortest way is 159 km
-179 to 179: 20276 km on 90, the shortest way is 159 km
reached: 59.0 181.0
EXPECTED
echo "as described"
