#!/usr/bin/env bash
# Gymnasium 1.4.0: make(render_mode="human") warns each time for an environment that draws arrays alone.
#
# Expected: no warning, or one a program: the HumanRendering wrapper is what the user has asked for.
# Seen: a UserWarning for every environment that is made. With warnings as errors, as in many tests, making it fails.
# An environment that lists "human" and applies HumanRendering itself does not warn.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet gymnasium==1.4.0 pygame-ce==2.5.8
cd "$folder"
cat > run.py <<'PY'
import warnings

import gymnasium as gym
import numpy as np


class Still(gym.Env):
    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}
    observation_space = gym.spaces.Box(0, 1, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, render_mode=None):
        self.render_mode = render_mode

    def render(self):
        return np.zeros((8, 8, 3), np.uint8)


gym.register("Still-v0", entry_point=Still)
for number in (1, 2):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        env = gym.make("Still-v0", render_mode="human")
        env.close()
    print(number, [(one.category.__name__, "doesn't natively support it" in str(one.message)) for one in seen])
PY
SDL_VIDEODRIVER=dummy "$folder/venv/bin/python" run.py 2>&1 | grep -v "^pygame" | tee output.txt
diff output.txt - <<'EXPECTED'
1 [('UserWarning', True)]
2 [('UserWarning', True)]
EXPECTED
echo "as described"
