#!/usr/bin/env bash
# rliable 1.2.0 with what its installation brought in November 2026 (arch 7.2.0, pandas 3.1.1) cannot be imported.
#
# Expected: `pip install rliable` takes versions that fit each other.
# Seen: it asks for arch below 8, and arch 7.2.0 for any pandas from 1.4 on. Importing rliable's library ends in a
# TypeError inside arch, which calls a helper of pandas that has one argument more since pandas 3. With pandas 2.3.3 it works.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
cat > "$folder/run.py" <<'PY'
from importlib.metadata import version

try:
    from rliable import library  # noqa: F401

    found = "imported"
except TypeError as error:
    found = repr(error)
print("pandas", version("pandas"), "arch", version("arch"), found)
PY
for pandas in 3.1.1 2.3.3; do
    "$folder/venv/bin/python" -m pip install --quiet rliable==1.2.0 arch==7.2.0 numpy==2.4.6 scipy==1.17.1 "pandas==$pandas"
    "$folder/venv/bin/python" "$folder/run.py"
done | tee "$folder/output.txt"
diff "$folder/output.txt" - <<'EXPECTED'
pandas 3.1.1 arch 7.2.0 TypeError("deprecate_kwarg() missing 1 required positional argument: 'new_arg_name'")
pandas 2.3.3 arch 7.2.0 imported
EXPECTED
echo "as described"
