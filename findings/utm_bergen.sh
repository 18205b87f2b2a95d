#!/usr/bin/env bash
# utm 0.9.0 and geopandas 1.2.0: the coast of western Norway and Svalbard lies in two zones.
#
# Expected: the same zone, so that metres of one are metres of the other.
# Seen: utm follows the exceptions of the grid (32V, 33X), `estimate_utm_crs` the plain six degrees: at Bergen the
# eastings differ by 330 km, and north by several degrees.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
  utm==0.9.0 geopandas==1.2.0 pandas==3.1.1 shapely==2.2.0 pyproj==3.7.2
cd "$folder"
cat > run.py <<'PY'
import geopandas as gpd
import utm
from shapely import Point

for name, longitude, latitude in (("Bergen", 5.32, 60.39), ("Svalbard", 10.0, 78.2), ("Copenhagen", 12.6, 55.7)):
    east, _, zone, letter = utm.from_latlon(latitude, longitude)
    place = gpd.GeoSeries([Point(longitude, latitude)], crs=4326)
    crs = place.estimate_utm_crs()
    print(name, f"utm {zone}{letter} {east:.0f},", f"geopandas {crs.utm_zone} {place.to_crs(crs).x[0]:.0f}")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
Bergen utm 32V 297230, geopandas 31N 627860
Svalbard utm 33X 385990, geopandas 32N 522828
Copenhagen utm 33U 349176, geopandas 33N 349176
EXPECTED
echo "as described"
