#!/usr/bin/env bash
# Stable-Baselines3 2.9.2: load_results mixes the episodes of a resumed run.
#
# Expected: Monitor(override_existing=False) appends to monitor.csv, and load_results returns the episodes in the
# order in which they happened.
# Seen: the appended rows count their time t from zero again, below the t_start of the first part. load_results
# sorts by t, so that episodes of the second part stand between those of the first. Returns over steps (ts2xy,
# plot_results) are then those of no run. Read the rows of one file in their order instead.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 stable-baselines3==2.9.2 gymnasium==1.4.0 pandas==3.1.1
cd "$folder"
cat > run.py <<'PY'
import time

import gymnasium as gym
import numpy as np
from stable_baselines3.common.monitor import Monitor, load_results


class Counted(gym.Env):
    """Episodes of one step; the reward is the number of the episode."""

    observation_space = gym.spaces.Box(0, 1, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, first: int) -> None:
        self.episode = first - 1

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episode += 1
        return np.zeros(1, np.float32), {}

    def step(self, action):
        time.sleep(0.2)
        return np.zeros(1, np.float32), float(self.episode), True, False, {}


for first, is_new in ((1, True), (4, False)):  # three episodes; then the run is resumed for three more
    env = Monitor(Counted(first), "log", override_existing=is_new)
    for _ in range(3):
        env.reset()
        env.step(0)
    env.close()
rows = [float(line.split(",")[0]) for line in open("log.monitor.csv").read().splitlines()[2:]]
print("file", rows)
print("load_results", load_results(".")["r"].tolist())
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
file [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
load_results [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]
EXPECTED
echo "as described"
