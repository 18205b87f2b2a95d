#!/usr/bin/env bash
# libais 0.17: a ship that says nothing of its turning turns to port at 731 degrees a minute.
#
# Expected: "not available" (-128 in the message) is NaN, a flag or 0.
# Seen: -731.4 with `rot_over_range` True, just as a ship that turns faster than its indicator can say (-127, which
# gives -720.0). Most ships have no indicator.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet libais==0.17 pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
import ais
from pyais import encode_dict

ship = {"msg_type": 1, "mmsi": 219000001, "lat": 55.0, "lon": 10.0, "speed": 12.0, "course": 45.0}
for word, turn in (("not available", -128.0), ("fast to port", -127.0), ("straight", 0.0)):
    (sentence,) = encode_dict({**ship, "turn": turn})
    report = ais.decode(sentence.split(",")[5], 0)
    print(f"{word}: {report['rot']:.1f} {report['rot_over_range']}")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
not available: -731.4 True
fast to port: -720.0 True
straight: 0.0 False
EXPECTED
echo "as described"
