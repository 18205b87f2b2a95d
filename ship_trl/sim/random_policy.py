"""What an agent gets that draws its actions at random: the zero of a score."""

from __future__ import annotations

import torch
from torch import Generator

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.transition import Transition

# The standard error of the mean return is then about 2.
EPISODES = 10_000


def random_return(case: Case, world: World, seed: int = 0, episodes: int = EPISODES) -> float:
    """Return the mean return of uniform random actions over so many episodes, drawn from `seed`.

    It belongs to the case: all runs take the same draws, so that they have one zero of the score.
    """
    reference = Transition(case, world, torch.device("cpu"))
    step, generator = CompiledStep(reference), Generator().manual_seed(seed)
    state = reference.start.expand(episodes, -1).contiguous()
    total = torch.zeros(episodes, dtype=torch.float64)
    sailing = torch.ones(episodes, dtype=torch.bool)
    while bool(sailing.any()):
        action = torch.randint(len(world.actions), (episodes,), generator=generator)
        after = step(state, action)
        total += after.reward * sailing
        sailing &= ~(after.goal | after.collision | after.truncated)
        state = after.state
    return float(total.mean())
