#!/usr/bin/env bash
# pyais 3.3.1, aiscat 0.68.16, libais 0.17: `gnss` of message 27 is True in one and False in the others.
#
# Expected: a flag of the same name has the same sense.
# Seen: the bit is 0 where the position is the satellite receiver's present one. pyais and aiscat give the bit, so
# `gnss` False is the good case; libais turns it round.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1 aiscat==0.68.16 libais==0.17
cd "$folder"
cat > run.py <<'PY'
import ais
import aiscat
from pyais import decode, encode_dict

ship = {"msg_type": 27, "mmsi": 219000001, "lat": 55.0, "lon": 10.0, "speed": 12, "course": 45}
for bit in (0, 1):
    (sentence,) = encode_dict({**ship, "gnss": bit})
    old = ais.decode(sentence.split(",")[5], 0)
    flags = {"pyais": decode(sentence).gnss, "aiscat": aiscat.decode(sentence)["gnss"], "libais": old["gnss"]}
    print("bit", bit, *(f"{name} {bool(flag)}" for name, flag in flags.items()))
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
bit 0 pyais False aiscat False libais True
bit 1 pyais True aiscat True libais False
EXPECTED
echo "as described"
