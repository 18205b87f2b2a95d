#!/usr/bin/env bash
# TorchRL 0.14.1: HardUpdate copies the target network every interval + 1 steps.
#
# Expected: HardUpdate(loss, value_network_update_interval=4) copies at the 4th, 8th and 12th call of step.
# Seen: it copies at the 5th, 10th and 15th call; with an interval of 1 at every second call. Give one less than
# the period that is wanted, or copy the parameters yourself.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 torchrl==0.14.1 tensordict==0.14.3
cd "$folder"
cat > run.py <<'PY'
import torch
from torchrl.data import Categorical
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, HardUpdate

for interval in (1, 4):
    actor = QValueActor(torch.nn.Linear(2, 3), in_keys=["observation"], spec=Categorical(3))
    loss = DQNLoss(actor, delay_value=True)
    updater = HardUpdate(loss, value_network_update_interval=interval)
    copied = []
    for step in range(1, 16):
        for parameter in actor.parameters():  # the online network, numbered by the step
            parameter.data.fill_(float(step))
        updater.step()
        target = next(iter(loss.target_value_network_params.values(True, True)))
        if float(target.flatten()[0]) == step:
            copied.append(step)
    print("interval", interval, "copied at", copied)
PY
"$folder/venv/bin/python" -W ignore run.py | tee output.txt
diff output.txt - <<'EXPECTED'
interval 1 copied at [2, 4, 6, 8, 10, 12, 14]
interval 4 copied at [5, 10, 15]
EXPECTED
echo "as described"
