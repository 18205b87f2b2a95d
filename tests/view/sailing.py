"""Episodes for the pictures: sailed for real, with made-up Q-values."""

from collections.abc import Sequence

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case
from ship_trl.sim.env import ShipEnv


def sail(case: Case, world: World, actions: Sequence[int]) -> Episode:
    """Sail the actions over and over until the episode ends; the chosen action has the highest Q."""
    env = ShipEnv(case, world, 1)
    step = env.reset()
    states: list[Tensor] = [step["state"][0]]
    chosen: list[Tensor] = []
    rewards: list[Tensor] = []
    while not bool(step["done"].all()):
        action = torch.tensor([actions[len(chosen) % len(actions)]])
        step = env.step(step.set("action", action))["next"]
        states.append(step["state"][0])
        chosen.append(action[0])
        rewards.append(step["reward"][0, 0])
    taken = torch.stack(chosen)
    q_values = 0.3 - 0.05 * (torch.arange(len(world.actions)) - taken[:, None]).abs()
    return Episode(
        states=torch.stack(states),
        actions=taken,
        q_values=q_values,
        rewards=torch.stack(rewards),
        goal=bool(step["goal"]),
        collision=bool(step["collision"]),
        dcpa=float(step["dcpa"]),
    )
