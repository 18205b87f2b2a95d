#!/usr/bin/env bash
# gymnasium 1.4.0: `NormalizeReward` scales the same rewards by 14.35, 0.63 or 3.33.
#
# Expected: the scale is that of the discounted return, which begins at 0 in each episode; how an episode ends, and how
# the environment is reset, does not change it. With a reward of 1 in the tenth of ten steps it is 1 / 0.3 = 3.33.
# Seen: 3.33 only in a vector environment that resets in the same step. Else the return of one episode is carried into
# the next: after a termination its last reward (14.35; 13.76 in a vector environment of the default mode), after a time
# limit all of it (0.63 and 0.61). So a goal is worth 23 times as much if reaching it terminates.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet gymnasium==1.4.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
from functools import partial

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import NormalizeReward
from gymnasium.wrappers.vector import NormalizeReward as VectorNormalizeReward


class Voyage(gym.Env):
    """Ten steps, a reward of 1 in the last."""

    observation_space = gym.spaces.Box(0, 1, (1,), np.float32)
    action_space = gym.spaces.Discrete(1)

    def __init__(self, end):
        self.end = end

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.count += 1
        last = self.count == 10
        terminated, truncated = last and self.end == "terminated", last and self.end == "truncated"
        return np.zeros(1, np.float32), float(last), terminated, truncated, {}


steps = 2000
for end in ("terminated", "truncated"):
    one = NormalizeReward(Voyage(end))
    one.reset()
    for _ in range(steps):
        _, reward, terminated, truncated, _ = one.step(0)
        if terminated or truncated:
            goal = float(reward)
            one.reset()
    print(f"{end}: one {goal:.2f}", end="")
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
        many = VectorNormalizeReward(SyncVectorEnv([partial(Voyage, end)], autoreset_mode=mode))
        many.reset()
        for _ in range(steps):
            _, reward, terminated, truncated, _ = many.step(np.zeros(1, int))
            if terminated[0] or truncated[0]:
                goal = float(reward[0])
        print(f", {mode.name} {goal:.2f}", end="")
    print()
returns = []
for _ in range(steps // 10):
    value = 0.0
    for step in range(10):
        value = value * 0.99 + (step == 9)
        returns.append(value)
print(f"by hand: {1 / np.std(returns):.2f}")
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
terminated: one 14.35, NEXT_STEP 13.76, SAME_STEP 3.33
truncated: one 0.63, NEXT_STEP 0.61, SAME_STEP 3.33
by hand: 3.33
EXPECTED
echo "as described"
