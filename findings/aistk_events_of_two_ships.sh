#!/usr/bin/env bash
# aistk 1.0.0: two ships that keep their courses make sharp turns.
#
# Expected: `detect_events` looks at each ship by itself, as `stats` does.
# Seen: the rows are taken as one track. Each change of ship in the table is a turn, five of 180 degrees in six rows
# that are sorted by time; the event has no MMSI that would show it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet aistk==1.0.0
cd "$folder"
cat > run.py <<'PY'
from datetime import datetime

import polars as pl
from aistk.events import detect_events_df
from aistk.stats import compute_stats_df

rows = [
    {"MMSI": mmsi, "ts": datetime(2024, 1, 1, 0, minute), "LAT": 55.0, "LON": 10.0, "COG": course, "SOG": 5.0}
    for minute in range(3)
    for mmsi, course in ((1, 0.0), (2, 180.0))
]
table = pl.DataFrame(rows)
print("turned in all:", compute_stats_df(table)["turn_index_deg"].to_list())
events = detect_events_df(table)
print(events.columns)
print(events["type"].unique().to_list(), events["delta_deg"].to_list())
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
turned in all: [0.0, 0.0]
['type', 'ts', 'delta_deg']
['sharp_turn'] [180.0, 180.0, 180.0, 180.0, 180.0]
EXPECTED
echo "as described"
