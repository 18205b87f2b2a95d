#!/usr/bin/env bash
# pandas 3.1.1 and polars 2.1.0: fixes at odd seconds, interpolated to every ten, are wrong in two ways.
#
# Expected: a place every ten seconds, on the line between the fix before and the fix after.
# Seen: pandas keeps the fixes between its times, but counts rows instead of seconds: a time between two fixes has the
# place halfway. A ship with a steady 10 m/s has 13.5, 6.5, 5.5 and 14.5. `method="time"` is right. The documentation
# says that the default ignores the index, and also that it suits resampling to times that do not match. polars drops
# those fixes, so a ship that lay still for 26 s moves on at 3.5 m/s. Each is right where the other is wrong.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet numpy==2.4.6 pandas==3.1.1 polars==2.1.0
cd "$folder"
cat > run.py <<'PY'
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import polars as pl

start = datetime(2026, 1, 1)
ships = {  # seconds of the fixes, metres made good
    "steady": ([0, 7, 20, 31, 40], [0.0, 70.0, 200.0, 310.0, 400.0]),
    "lay still": ([0, 7, 33, 40], [0.0, 70.0, 70.0, 140.0]),
}
for name, (seconds, metres) in ships.items():
    times = [start + timedelta(seconds=second) for second in seconds]
    row = pd.Series(metres, pd.DatetimeIndex(times)).resample("10s")
    table = pl.DataFrame({"time": times, "metres": metres}).upsample("time", every="10s")
    print(name)
    print("  expected", np.interp(range(0, 50, 10), seconds, metres).tolist())
    print("  pandas", row.interpolate().tolist())
    print("  pandas, time", row.interpolate(method="time").round(9).tolist())
    print("  polars", table["metres"].interpolate().to_list())
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
steady
  expected [0.0, 100.0, 200.0, 300.0, 400.0]
  pandas [0.0, 135.0, 200.0, 255.0, 400.0]
  pandas, time [0.0, 100.0, 200.0, 300.0, 400.0]
  polars [0.0, 100.0, 200.0, 300.0, 400.0]
lay still
  expected [0.0, 70.0, 70.0, 70.0, 140.0]
  pandas [0.0, 70.0, 70.0, 70.0, 140.0]
  pandas, time [0.0, 70.0, 70.0, 70.0, 140.0]
  polars [0.0, 35.0, 70.0, 105.0, 140.0]
EXPECTED
echo "as described"
