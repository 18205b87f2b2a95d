#!/usr/bin/env bash
# torch 2.13.0: a fused optimiser changes weights without telling autograd.
#
# Expected: after a step, the gradient of a graph that was built before it is refused ("modified by an inplace
# operation"), and `tensor._version` has grown, as with foreach=True and with the plain loop.
# Seen: with fused=True the version stays, the gradient is computed without a word, and it is that of the new weights.
# Caches that hang on `_version` go stale. torch.autograd.graph.increment_version(parameters) after each step mends both.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
import torch

for kind in ({"fused": True}, {"foreach": True}, {"foreach": False}):
    one, two = (torch.nn.Parameter(torch.tensor([value])) for value in (2.0, 3.0))
    optimiser = torch.optim.Adam([one, two], lr=0.5, **kind)
    product = (one * two).sum()  # its gradient for one is two, 3
    one.grad, two.grad = torch.ones(1), torch.ones(1)
    before = two._version
    optimiser.step()
    try:
        found = f"{torch.autograd.grad(product, one)[0].item():.1f}"
    except RuntimeError as error:
        found = "refused" if "inplace operation" in str(error) else str(error)
    print(kind, "version +", two._version - before, "old gradient", found)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
{'fused': True} version + 0 old gradient 2.5
{'foreach': True} version + 1 old gradient refused
{'foreach': False} version + 1 old gradient refused
EXPECTED
echo "as described"
