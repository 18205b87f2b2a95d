#!/usr/bin/env bash
# traja 25.0.1 with pandas 3: a ship whose fixes have time stamps is a thousand times as fast.
#
# Expected: a steady ship with fixes each 10 s and 100 m has 10 m/s, whether times are seconds or time stamps.
# Seen: with time stamps 10,000 m/s: traja takes a stamp's integer for nanoseconds, but stamps made by pandas 3 have
# microseconds. With pandas 2.3.3, or stamps turned into nanoseconds first, both agree. Nothing warns.
# Its import needs scikit-learn, which its installation does not bring.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
cat > "$folder/run.py" <<'PY'
import pandas as pd
import traja

stamps = pd.date_range("2026-01-01", periods=4, freq="10s")
seconds = [0.0, 10.0, 20.0, 30.0]
for name, times in (("seconds", seconds), ("time stamps", stamps), ("as nanoseconds", stamps.as_unit("ns"))):
    track = traja.TrajaDataFrame({"x": [0.0, 100.0, 200.0, 300.0], "y": [0.0] * 4, "time": times})
    speed = traja.get_derivatives(track)["speed"].iloc[1]
    print(f"pandas {pd.__version__}, {name}: {speed:.0f} m/s")
PY
for pandas in 3.1.1 2.3.3; do
    "$folder/venv/bin/python" -m pip install --quiet traja==25.0.1 scikit-learn==1.9.1 numpy==2.4.6 scipy==1.17.1 "pandas==$pandas"
    "$folder/venv/bin/python" "$folder/run.py"
done | tee "$folder/output.txt"
diff "$folder/output.txt" - <<'EXPECTED'
pandas 3.1.1, seconds: 10 m/s
pandas 3.1.1, time stamps: 10000 m/s
pandas 3.1.1, as nanoseconds: 10 m/s
pandas 2.3.3, seconds: 10 m/s
pandas 2.3.3, time stamps: 10 m/s
pandas 2.3.3, as nanoseconds: 10 m/s
EXPECTED
echo "as described"
