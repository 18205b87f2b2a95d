"""Stable-Baselines3's DQN and PPO on random encounters as numbers, many ships side by side."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from tensordict import TensorDictBase

from ship_trl.config.network import load_network
from ship_trl.gym import ShipCollisionVectorEnv
from ship_trl.learn.rollout import Policy
from ship_trl.sim.cases import load_world
from ship_trl.sim.vector import VectorObservation

NUM_ENVS = 64
# Ours takes about as many in its 26,000 episodes; a number of whole rollouts of PPO.
STEPS = 290 * 4096
# All ships at once: layers that see one ship at a time are ours.
REWARD_SCALE, GAMMA, LAYERS = 0.1, 0.97, [256, 256, 256]
# Settings that Stable-Baselines3's users would choose; the rest is as in the recipe double_dqn_traffic.
DQN_SETTINGS: dict[str, Any] = {
    "learning_rate": 5e-4,
    "buffer_size": 200_000,
    "learning_starts": 2000,
    "batch_size": 128,
    "n_steps": 3,
    # Four updates every 64 steps, and the target network follows by as much as by 0.01 an update.
    "train_freq": 1,
    "gradient_steps": 4,
    "target_update_interval": NUM_ENVS,
    "tau": 0.04,
    "exploration_fraction": 0.33,
    "exploration_final_eps": 0.03,
}
PPO_SETTINGS: dict[str, Any] = {
    "learning_rate": 3e-4,
    "n_steps": 64,
    "batch_size": 512,
    "n_epochs": 10,
    "ent_coef": 0.01,
}
# Takes the greedy policy, the steps so far and whether training ends; returns whether to continue.
Record = Callable[[Policy, int, bool], bool]


class ShipVecEnv(VecEnv):
    """The vector environment for Gymnasium, with the methods that Stable-Baselines3 calls."""

    def __init__(self, envs: ShipCollisionVectorEnv) -> None:
        self._envs, self._actions = envs, np.zeros(envs.num_envs, np.int64)
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> NDArray[Any]:
        """Begin all episodes; return observations [N, ...]."""
        observations, _ = self._envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return observations

    def step_async(self, actions: NDArray[np.int64]) -> None:
        """Keep the actions [N] for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step; return observations, rewards, ends of episodes [N], and a dict for each ship."""
        observations, rewards, terminated, truncated, infos = self._envs.step(self._actions)
        over, told = terminated | truncated, [dict[str, Any]() for _ in range(self.num_envs)]
        for row in over.nonzero()[0]:
            told[row] = {
                "terminal_observation": infos["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row]),
            }
        return observations, rewards, over, told

    def close(self) -> None:
        """Close the environment."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, the same for all ships."""
        return [getattr(self._envs, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: single ships have no attributes."""
        raise NotImplementedError

    def env_method(self, method_name: str, *method_args: Any, **method_kwargs: Any) -> list[Any]:
        """Refuse: single ships have no methods."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Return that no ship is wrapped."""
        return [False] * self.num_envs


class Recorder(BaseCallback):
    """Calls `record` after every step, and ends the training when it says so."""

    def __init__(self, record: Record, policy: Policy) -> None:
        super().__init__()
        self._record, self._policy = record, policy

    def _on_step(self) -> bool:
        return self._record(self._policy, self.num_timesteps, self.num_timesteps >= STEPS)


def greedy_policy(model: BaseAlgorithm) -> Policy:
    """Return a model's greedy policy, which reads `state` [N, S] and writes `action` int64 [N]."""
    observe = VectorObservation(load_world(), load_network("vector").ships)

    def act(step: TensorDictBase) -> TensorDictBase:
        action, _ = model.predict(observe(step["state"]).numpy(), deterministic=True)
        return step.set("action", torch.from_numpy(action))

    return act


def train(kind: Callable[..., BaseAlgorithm], settings: dict[str, Any], seed: int, record: Record) -> None:
    """Train a model on suite `traffic` for `STEPS` steps, or until `record` returns False."""
    envs = ShipCollisionVectorEnv(NUM_ENVS, "traffic", reward_scale=REWARD_SCALE, observation="vector")
    common: dict[str, Any] = {"gamma": GAMMA, "policy_kwargs": {"net_arch": LAYERS}, "device": "cpu"}
    model = kind("MlpPolicy", ShipVecEnv(envs), seed=seed, **common, **settings)
    model.learn(STEPS, Recorder(record, greedy_policy(model)))


train_dqn, train_ppo = partial(train, DQN, DQN_SETTINGS), partial(train, PPO, PPO_SETTINGS)
