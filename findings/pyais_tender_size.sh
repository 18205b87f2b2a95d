#!/usr/bin/env bash
# pyais 2.6.6 and libais 0.17: a ship's tender is 322 m long and 52 m wide.
#
# Expected: message 24 part B of an auxiliary craft (MMSI 98...) has the mother ship's MMSI in the place of its size.
# Seen: pyais 3.3.1 gives `mothership_mmsi`; pyais 2.6.6 and libais read its bits as metres from the bow, stern,
# port and starboard sides.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet libais==0.17 pyais==2.6.6
cd "$folder"
cat > run.py <<'PY'
import ais
import pyais

sentence = "!AIVDM,1,1,,A,H>`d7dDU1230000?Hi0000=3Jk10,0*16"
report = pyais.decode(sentence).asdict()
names = ("mothership_mmsi", "to_bow", "to_stern", "to_port", "to_starboard")
print("pyais", {name: report[name] for name in names if name in report})
old = ais.decode(sentence.split(",")[5], 0)
print("libais", [old[name] for name in ("dim_a", "dim_b", "dim_c", "dim_d")])
PY
"$folder/venv/bin/python" run.py | tee output.txt
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
"$folder/venv/bin/python" run.py | tee -a output.txt
diff output.txt - <<'EXPECTED'
pyais {'to_bow': 104, 'to_stern': 218, 'to_port': 51, 'to_starboard': 1}
libais [104, 218, 51, 1]
pyais {'mothership_mmsi': 219000001}
libais [104, 218, 51, 1]
EXPECTED
echo "as described"
