#!/usr/bin/env bash
# pandas 3.1.1: the integers behind times change their unit from one part of a file to the next.
#
# Expected: one unit in all parts of a file, and `Timestamp.value` equal to the column's integer.
# Seen: a part in which one stamp has nine decimals is in nanoseconds, the others in microseconds; `value` is in
# nanoseconds always. Gaps computed from `astype("int64")` are a thousand times too long in one part.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pandas==3.1.1
cd "$folder"
cat > run.py <<'PY'
import io

import pandas as pd

stamps = ["00:00:00", "00:01:00", "00:02:00", "00:03:00.000000001"]
text = "time\n" + "".join(f"2024-01-01 {stamp}\n" for stamp in stamps)
for part in pd.read_csv(io.StringIO(text), parse_dates=["time"], date_format="ISO8601", chunksize=2):
    numbers = part.time.astype("int64").tolist()
    print(part.time.dtype, numbers[1] - numbers[0])
column = pd.Series(pd.to_datetime(["2024-01-01"]))
print(column.dtype, column.astype("int64")[0], column[0].unit, column[0].value)
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
datetime64[us] 60000000
datetime64[ns] 60000000001
datetime64[us] 1704067200000000 us 1704067200000000000
EXPECTED
echo "as described"
