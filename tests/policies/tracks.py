"""Trajectories made by hand: actions held one after the other."""

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import advance

PORT, STRAIGHT, STARBOARD = 0, 3, 6


def track(world: World, case: Case, *held: tuple[int, int]) -> Tensor:
    """Return the states [T + 1, S] of (action, steps) held one after the other."""
    states = [initial_state(case, world)]
    actions = torch.tensor(world.actions)
    for action, steps in held:
        for _ in range(steps):
            states.append(advance(states[-1], torch.tensor(action), actions, world.dt))
    return torch.stack(states)
