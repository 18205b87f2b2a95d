#!/usr/bin/env bash
# pyproj 3.7.2, geographiclib 2.1, movingpandas 0.23.0: the course of a ship that lies still.
#
# Expected: NaN, or 0 everywhere, or at least the same from all of them.
# Seen: south (180) north of the equator and on it, north (0) south of it, from pyproj and geographiclib; north
# everywhere from movingpandas. A moored ship on 35 S turns round if its copy on 55 N is compared.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
  pyproj==3.7.2 geographiclib==2.1 movingpandas==0.23.0 geopandas==1.2.0 pandas==3.1.1 shapely==2.2.0
cd "$folder"
cat > run.py <<'PY'
import warnings

warnings.simplefilter("ignore")
import movingpandas as mpd
import pandas as pd
from geographiclib.geodesic import Geodesic
from pyproj import Geod

times = pd.to_datetime(["2024-01-01 00:00", "2024-01-01 00:10"])
for latitude in (55.0, 0.0, -35.0):
    course = Geod(ellps="WGS84").inv(10.0, latitude, 10.0, latitude)[0]
    other = Geodesic.WGS84.Inverse(latitude, 10.0, latitude, 10.0)["azi1"]
    fixes = pd.DataFrame({"t": times, "x": 10.0, "y": latitude})
    ship = mpd.Trajectory(fixes, 1, t="t", x="x", y="y", crs=4326)
    ship.add_direction()
    print(latitude, "pyproj", course, "geographiclib", other, "movingpandas", ship.df.direction.iloc[1])
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
55.0 pyproj 180.0 geographiclib 180.0 movingpandas 0.0
0.0 pyproj 180.0 geographiclib 180.0 movingpandas 0.0
-35.0 pyproj 0.0 geographiclib 0.0 movingpandas 0.0
EXPECTED
echo "as described"
