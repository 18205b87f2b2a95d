#!/usr/bin/env bash
# trafficgen 0.9.1: the command's default input is not in the package.
#
# Expected: `trafficgen gen-situation -o out` writes the baseline situations, as its help names defaults.
# Seen: exit code 2. The defaults lie in a folder `data` beside the source, which the wheel leaves out.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet trafficgen==0.9.1
cd "$folder"
mkdir out
code=0
"$folder/venv/bin/trafficgen" gen-situation -o out > said.txt 2>&1 || code=$?
{
  grep "^Error" said.txt | sed "s|Path '.*/data|Path '.../data|"
  echo "exit code $code"
  echo "$(find out -type f | wc -l) situations written"
} | tee output.txt
diff output.txt - <<'EXPECTED'
Error: Invalid value for '-s' / '--situations': Path '.../data/baseline_situations_input' does not exist.
exit code 2
0 situations written
EXPECTED
echo "as described"
