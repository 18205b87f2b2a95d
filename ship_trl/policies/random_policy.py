"""The mean return of a uniform random policy, which is the zero of all scores."""

from __future__ import annotations

import torch
from torch import Generator

from ship_trl.config.types import World
from ship_trl.sim.starts import make_starts
from ship_trl.sim.suites import Suite
from ship_trl.sim.transition import make_step

# With this many episodes the standard error of the mean return is about 2.
EPISODES = 10_000


def random_return(
    suite: Suite, world: World, seed: int = 0, episodes: int = EPISODES, *, fast: bool = True
) -> float:
    """Return the mean undiscounted raw return of uniform random actions in a suite, its cases in turn.

    All runs use the same seed of actions and starts, so that their scores share one zero. `fast` is of
    `make_step`.
    """
    step, generator = make_step(world, fast=fast), Generator().manual_seed(seed)
    state = make_starts(suite, world).balanced(episodes, generator).contiguous()
    total = torch.zeros(episodes, dtype=torch.float64)
    running = torch.ones(episodes, dtype=torch.bool)
    while bool(running.any()):
        action = torch.randint(len(world.actions), (episodes,), generator=generator)
        after = step(state, action)
        total += after.reward * running
        running &= ~(after.goal | after.collision | after.truncated)
        state = after.state
    return float(total.mean())
