"""Greedy evaluation: the world is deterministic, so one rollout is exact."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torchrl.envs import EnvBase

from ship_trl.learn.agent import Agent


@dataclass(frozen=True)
class Episode:
    """One episode as it was sailed.

    `states` float [T + 1, S], `actions` int64 [T], `q_values` float [T, A], `rewards` float [T],
    raw; `dcpa` in metres, infinite without target ships.
    """

    states: Tensor
    actions: Tensor
    q_values: Tensor
    rewards: Tensor
    goal: bool
    collision: bool
    dcpa: float

    @property
    def total(self) -> float:
        """The return: undiscounted sum of raw rewards."""
        return float(self.rewards.sum(dtype=torch.float64))

    @property
    def length(self) -> int:
        """Steps sailed."""
        return len(self.actions)

    @property
    def outcome(self) -> str:
        """goal, collision or timeout."""
        return outcome(self.goal, self.collision)


def outcome(goal: bool, collision: bool) -> str:
    """Name of how an episode ended."""
    return "goal" if goal else "collision" if collision else "timeout"


def evaluate(env: EnvBase, agent: Agent) -> Episode:
    """Sail one greedy episode in an environment with a batch of one."""
    step = env.reset()
    states, actions, q_values, rewards = [step["state"][0]], [], [], []
    while not bool(step["done"].all()):
        q = agent.q_values(step["state"])
        action = q.argmax(-1)
        step = env.step(step.set("action", action))["next"]
        states.append(step["state"][0])
        actions.append(action[0])
        q_values.append(q[0])
        rewards.append(step["reward"][0, 0])
    return Episode(
        states=torch.stack(states).cpu(),
        actions=torch.stack(actions).cpu(),
        q_values=torch.stack(q_values).cpu(),
        rewards=torch.stack(rewards).cpu(),
        goal=bool(step["goal"][0, 0]),
        collision=bool(step["collision"][0, 0]),
        dcpa=float(step["dcpa"][0, 0]),
    )
