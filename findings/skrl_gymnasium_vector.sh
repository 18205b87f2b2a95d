#!/usr/bin/env bash
# skrl 2.1.1 with a vector environment of Gymnasium 1.4.0: false transitions, and an axis of vector steps.
#
# Expected: skrl's wrapper handles Gymnasium's default autoreset (NEXT_STEP); episodes of five steps are logged as five
# steps; the axis of TensorBoard counts the steps of all environments, as Stable-Baselines3 does.
# Seen with four environments whose episodes last five steps:
# - NEXT_STEP (the default of gymnasium's vector environments): the replay memory holds a transition from the last
#   observation to the first of the next episode, reward 0, not terminated. Every episode but the first is logged with
#   six steps.
# - SAME_STEP: lengths are right; the next observation of an episode's last transition is the next episode's first, as
#   skrl does not read final_obs. That is wrong where an episode is truncated and its value is bootstrapped.
# - The axis counts steps of the vector: 60 "timesteps" are 240 transitions. A curve of skrl with n environments beside
#   one of Stable-Baselines3 looks n times as sample-efficient as it is.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 skrl==2.1.1 gymnasium==1.4.0 tensorboard==2.21.0
cd "$folder"
cat > run.py <<'PY'
import glob

import gymnasium as gym
import numpy as np
from skrl.agents.torch.dqn import DQN, DQN_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, Model
from skrl.trainers.torch import SequentialTrainer
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch import nn


class FiveSteps(gym.Env):
    """Observes the number of steps taken; ends after five, each of reward 1."""

    observation_space = gym.spaces.Box(0, 9, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.array([self.steps], np.float32), 1.0, self.steps == 5, False, {}


class Network(DeterministicMixin, Model):
    def __init__(self, env):
        Model.__init__(
            self, observation_space=env.observation_space, action_space=env.action_space, device=env.device
        )
        DeterministicMixin.__init__(self)
        self.layer = nn.Linear(1, 2)

    def compute(self, inputs, role=""):
        return self.layer(inputs["observations"]), {}


for mode in (gym.vector.AutoresetMode.NEXT_STEP, gym.vector.AutoresetMode.SAME_STEP):
    env = wrap_env(gym.vector.SyncVectorEnv([FiveSteps] * 4, autoreset_mode=mode), verbose=False)
    memory = RandomMemory(memory_size=60, num_envs=4)
    config = DQN_CFG()
    config.learning_starts = 10**6  # nothing is learned: only what is stored and logged counts
    config.experiment.directory = mode.name
    config.experiment.write_interval = 60
    config.experiment.checkpoint_interval = 0
    agent = DQN(
        models={name: Network(env) for name in ("q_network", "target_q_network")},
        memory=memory,
        cfg=config,
        observation_space=env.observation_space,
        action_space=env.action_space,
        device=env.device,
    )
    trainer = {"timesteps": 60, "headless": True, "disable_progressbar": True, "close_environment_at_exit": False}
    SequentialTrainer(env=env, agents=agent, cfg=trainer).train()
    rows = [
        [int(memory.get_tensor_by_name(name)[step, 0, 0]) for step in range(7)]
        for name in ("observations", "next_observations", "rewards", "terminated")
    ]
    print(mode.name, "obs", rows[0], "next", rows[1], "reward", rows[2], "terminated", rows[3])
    log = EventAccumulator(glob.glob(f"{mode.name}/**/events*", recursive=True)[0]).Reload()
    points = log.Scalars("Episode / Total timesteps (max)")
    print(mode.name, "longest episode", points[-1].value, "at step", points[-1].step)
PY
"$folder/venv/bin/python" run.py | grep _STEP | tee output.txt
diff output.txt - <<'EXPECTED'
NEXT_STEP obs [0, 1, 2, 3, 4, 5, 0] next [1, 2, 3, 4, 5, 0, 1] reward [1, 1, 1, 1, 1, 0, 1] terminated [0, 0, 0, 0, 1, 0, 0]
NEXT_STEP longest episode 6.0 at step 60
SAME_STEP obs [0, 1, 2, 3, 4, 0, 1] next [1, 2, 3, 4, 0, 1, 2] reward [1, 1, 1, 1, 1, 1, 1] terminated [0, 0, 0, 0, 1, 0, 0]
SAME_STEP longest episode 5.0 at step 60
EXPECTED
echo "as described"
