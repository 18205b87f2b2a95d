#!/usr/bin/env bash
# pandas 3.1.1 and polars 2.1.0: of a Danish AIS file they read different months, without a warning.
#
# Expected: "04/03/2024", the day first, is read alike by both, or one of them asks.
# Seen: 3 April for pandas, 4 March for polars. As all rows of a daily file have one date, no row contradicts: the
# first twelve days of a month are wrong, the others right (with a UserWarning).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pandas==3.1.1 polars==2.1.0
cd "$folder"
cat > run.py <<'PY'
import io
import warnings

import pandas as pd
import polars as pl

for day in ("04/03/2024", "12/03/2024", "13/03/2024"):
    text = f"# Timestamp,MMSI\n{day} 00:00:00,219000001\n{day} 23:59:59,219000001\n"
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        pandas_day = pd.read_csv(io.StringIO(text), parse_dates=[0]).iloc[0, 0]
        polars_day = pl.read_csv(io.StringIO(text), try_parse_dates=True)[0, 0]
    print(day, pandas_day.date(), polars_day.date(), [one.category.__name__ for one in seen])
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
04/03/2024 2024-04-03 2024-03-04 []
12/03/2024 2024-12-03 2024-03-12 []
13/03/2024 2024-03-13 2024-03-13 ['UserWarning']
EXPECTED
echo "as described"
