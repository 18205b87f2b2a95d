#!/usr/bin/env bash
# rliable 1.2.0: the intervals of runs ignore the given random state.
#
# Expected: the documentation of `get_interval_estimates` and `StratifiedBootstrap` says that `random_state` makes
# the estimates reproducible: two calls with RandomState(3) give the same interval.
# Seen: they differ, as two calls without it do: resamples are drawn from NumPy's global generator, and only
# np.random.seed makes them repeatable. The probability of improvement of one algorithm over another is no exception.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet rliable==1.2.0 arch==7.2.0 numpy==2.4.6 scipy==1.17.1 pandas==2.3.3
cd "$folder"
cat > run.py <<'PY'
import warnings

import numpy as np
from numpy.random import RandomState
from rliable import library, metrics

warnings.simplefilter("ignore")
draw = np.random.default_rng(0).normal
runs = {"a": draw(0.5, 0.1, (10, 1)), "b": draw(0.6, 0.1, (10, 1))}


def mean(scores):
    return np.array([metrics.aggregate_mean(scores)])


def same(samples, measure, before=lambda: None, **given):
    found = []
    for _ in range(2):
        before()
        state = {"random_state": RandomState(3)} if given else {}
        found.append(library.get_interval_estimates(samples, measure, reps=500, **state)[1])
    return all(np.array_equal(found[0][key], found[1][key]) for key in found[0])


print("no state: same interval", same(runs, mean))
print("random_state: same interval", same(runs, mean, random_state=True))
print("np.random.seed: same interval", same(runs, mean, lambda: np.random.seed(3)))
pair = {"a,b": (runs["a"], runs["b"])}
print("probability of improvement: same interval", same(pair, metrics.probability_of_improvement, random_state=True))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
no state: same interval False
random_state: same interval False
np.random.seed: same interval True
probability of improvement: same interval False
EXPECTED
echo "as described"
