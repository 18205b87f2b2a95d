#!/usr/bin/env bash
# movingpandas 0.23.0: between two fixes across 180 degrees a ship is off Africa.
#
# Expected: length, speed and place agree, as all three are given for longitude and latitude (EPSG:4326).
# Seen: length and speed are of the short way, 22 km; the place halfway is longitude 0, on the other side of the earth.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
  movingpandas==0.23.0 geopandas==1.2.0 pandas==3.1.1 shapely==2.2.0
cd "$folder"
cat > run.py <<'PY'
import warnings
from datetime import datetime

warnings.simplefilter("ignore")
import movingpandas as mpd
import pandas as pd

times = pd.to_datetime(["2024-01-01 00:00", "2024-01-01 00:10"])
fixes = pd.DataFrame({"t": times, "x": [179.9, -179.9], "y": [0.0, 0.0]})
ship = mpd.Trajectory(fixes, 1, t="t", x="x", y="y", crs=4326)
ship.add_speed()
print(f"length {ship.get_length():.0f} m, speed {ship.df.speed.iloc[1]:.1f} m/s")
print("halfway", ship.interpolate_position_at(datetime(2024, 1, 1, 0, 5)))
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
length 22264 m, speed 37.1 m/s
halfway POINT (0 0)
EXPECTED
echo "as described"
