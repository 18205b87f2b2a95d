#!/usr/bin/env bash
# rich 15.0.0: a column with a min_width gets no width at all when the table is too wide for the console.
#
# Expected: beside a column that may not wrap, one with min_width=12 keeps 12 characters, or the table is cut.
# Seen: it collapses to nothing, header and numbers included, and nothing says so. In a log file or a narrow terminal
# the numbers of a table are gone. Let the other column wrap, or print with a console that is wide enough.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet rich==15.0.0
cd "$folder"
cat > run.py <<'PY'
from rich import box
from rich.console import Console
from rich.table import Table

for no_wrap in (False, True):
    table = Table(box=box.ASCII)
    table.add_column("run", no_wrap=no_wrap)
    table.add_column("return", min_width=12)
    table.add_row("a-name-of-a-run-with-many-settings-in-it", "-123.4567890")
    Console(width=40).print(table)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
+--------------------------------------+
| run                   | return       |
|-----------------------+--------------|
| a-name-of-a-run-with… | -123.4567890 |
+--------------------------------------+
+--------------------------------------+
| run                                 ||
|-------------------------------------+|
| a-name-of-a-run-with-many-settings… ||
+--------------------------------------+
EXPECTED
echo "as described"
