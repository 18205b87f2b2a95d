#!/usr/bin/env bash
# safetensors 0.8.0: a transposed numpy array is saved scrambled; 0.7.0 saved it right.
#
# Expected: the array comes back, or an error, as `safetensors.torch` gives for a tensor that is not contiguous.
# Seen: 0.7.0 is right. 0.8.0 writes the memory as it lies under the shape that the array has: right shape, right
# type, wrong places. Weights that were transposed for another framework are silently spoilt.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet safetensors==0.7.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
import numpy as np
import safetensors
from safetensors.numpy import load, save

weights = np.arange(6, dtype=np.float32).reshape(2, 3).T
back = load(save({"weights": weights}))["weights"]
print(safetensors.__version__, weights.tolist(), back.tolist(), bool((back == weights).all()))
PY
"$folder/venv/bin/python" run.py | tee output.txt
"$folder/venv/bin/python" -m pip install --quiet safetensors==0.8.0
"$folder/venv/bin/python" run.py | tee -a output.txt
diff output.txt - <<'EXPECTED'
0.7.0 [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]] [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]] True
0.8.0 [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]] [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]] False
EXPECTED
echo "as described"
