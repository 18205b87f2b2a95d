#!/usr/bin/env bash
# Stable-Baselines3 2.9.2: a resumed run overwrites the evaluations of its first part.
#
# Expected: EvalCallback(log_path=...) of a run that goes on with reset_num_timesteps=False adds to evaluations.npz.
# Seen: a new callback begins an empty list and writes it over the file. What was measured before is lost, and the
# curve begins in the middle of the run. Give each part a log_path of its own.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 stable-baselines3==2.9.2 gymnasium==1.4.0
cd "$folder"
cat > run.py <<'PY'
import gymnasium as gym
import numpy as np
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.monitor import Monitor

make = lambda: Monitor(gym.make("CartPole-v1"))
DQN("MlpPolicy", make(), seed=0).learn(200, EvalCallback(make(), eval_freq=100, log_path=".", verbose=0)).save("m")
print(np.load("evaluations.npz")["timesteps"].tolist())
model = DQN.load("m", make())
model.learn(200, EvalCallback(make(), eval_freq=100, log_path=".", verbose=0), reset_num_timesteps=False)
print(np.load("evaluations.npz")["timesteps"].tolist())
PY
"$folder/venv/bin/python" -W ignore run.py | tee output.txt
diff output.txt - <<'EXPECTED'
[100, 200]
[300, 400]
EXPECTED
echo "as described"
