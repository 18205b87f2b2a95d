#!/usr/bin/env bash
# numba 0.68.1: np.median of values with a NaN is a number in a compiled function, and hangs on their order.
#
# Expected: NaN, as NumPy gives, and as numba's own np.quantile, np.mean and np.max give.
# Seen: the median of [nan, 1.0, 0.5] is 1.0, and NaN if the NaN stands last. Runs without a value then count as if
# they had one. Take np.quantile(x, 0.5), or test for NaN first.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet numba==0.68.1 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
import itertools

import numba
import numpy as np


def median(x):
    return np.median(x)


def quantile(x):
    return np.quantile(x, 0.5)


rows = [np.array(row) for row in itertools.permutations((np.nan, 1.0, 0.5))]
functions = {"NumPy median": median, "numba median": numba.njit(median), "numba quantile": numba.njit(quantile)}
for name, function in functions.items():
    print(name, [float(function(row)) for row in rows])
PY
"$folder/venv/bin/python" -W ignore run.py | tee output.txt
diff output.txt - <<'EXPECTED'
NumPy median [nan, nan, nan, nan, nan, nan]
numba median [1.0, 1.0, nan, 1.0, nan, 1.0]
numba quantile [nan, nan, nan, nan, nan, nan]
EXPECTED
echo "as described"
