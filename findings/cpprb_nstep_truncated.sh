#!/usr/bin/env bash
# cpprb 11.0.0: after a truncated episode, n-step transitions lead to a state of ones.
#
# Expected: the transitions that an episode's end shortens lead to its last observation. Where the episode was truncated
# they are not done, so a learner bootstraps from it; `on_episode_end` is documented for this case.
# Seen: the n - 1 last transitions have a next observation of ones, whatever was observed, and are not done. Their rewards
# are right. With n = 1 the observation is too.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet cpprb==11.0.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PY'
from cpprb import ReplayBuffer

for steps in (1, 3):
    fields = {"obs": {"shape": 2}, "rew": {}, "next_obs": {"shape": 2}, "done": {}}
    given = {"Nstep": {"size": steps, "gamma": 0.5, "rew": "rew", "next": "next_obs"}} if steps > 1 else {}
    replay = ReplayBuffer(100, fields, **given)
    for k in range(4):
        replay.add(obs=(k, 100 + k), rew=10 + k, next_obs=(k + 1, 101 + k), done=0)
    replay.on_episode_end()
    found = replay.get_all_transitions()
    for row in zip(*(found[name].tolist() for name in fields)):
        print(steps, *row)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
1 [0.0, 100.0] [10.0] [1.0, 101.0] [0.0]
1 [1.0, 101.0] [11.0] [2.0, 102.0] [0.0]
1 [2.0, 102.0] [12.0] [3.0, 103.0] [0.0]
1 [3.0, 103.0] [13.0] [4.0, 104.0] [0.0]
3 [0.0, 100.0] [18.5] [3.0, 103.0] [0.0]
3 [1.0, 101.0] [20.25] [4.0, 104.0] [0.0]
3 [2.0, 102.0] [18.5] [1.0, 1.0] [0.0]
3 [3.0, 103.0] [13.0] [1.0, 1.0] [0.0]
EXPECTED
echo "as described"
