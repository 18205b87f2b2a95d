"""Draw the initial states of a suite's episodes."""

from __future__ import annotations

import math

import torch
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.sim.state import (
    HEADING,
    SHIP_SPEED,
    X,
    Y,
    goal_distance,
    initial_state,
    is_present,
    relative_positions,
    target_ships,
)
from ship_trl.sim.suites import Suite

# Perturbed starts inside the safe distance or at the goal are drawn again, at most this often.
MAX_DRAWS = 100


class Starts:
    """Draws initial states of a suite.

    Args:
        suite: cases and perturbation.
        world: the actions, and the two distances that a start keeps.

    Attributes:
        states: initial states of the suite's cases, float32 [cases, S].
    """

    def __init__(self, suite: Suite, world: World) -> None:
        self.suite, self.world = suite, world
        self.states = torch.stack([initial_state(case, world, suite.places) for case in suite.cases])

    def sample(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S]. A suite whose episodes begin alike draws no numbers.

        Raises:
            ConfigError: too few perturbed starts keep the safe distance.
        """
        if len(self.states) == 1:
            states = self.states.repeat(count, 1)
        else:
            states = self.states[torch.randint(len(self.states), (count,), generator=generator)]
        if self.suite.perturbation.is_none:
            return states
        perturbed, invalid = states.clone(), torch.ones(count, dtype=torch.bool)
        for _ in range(MAX_DRAWS):
            perturbed[invalid] = self._perturb(states[invalid], generator)
            invalid = ~self._is_valid(perturbed)
            if not bool(invalid.any()):
                return perturbed
        raise ConfigError(
            f"suite {self.suite.name}: perturbation: too large, as nearly every start is inside the safe "
            "distance or at the goal; allowed: smaller bounds"
        )

    def _perturb(self, states: Tensor, generator: Generator) -> Tensor:
        """Return perturbed copies of states [N, S]."""
        bounds, count, places = self.suite.perturbation, len(states), self.suite.places
        own = 2 * torch.rand(count, 3, generator=generator) - 1
        other = 2 * torch.rand(count, places, 3, generator=generator) - 1
        states = states.clone()
        states[:, [X, Y]] += bounds.own_position * own[:, :2]
        states[:, HEADING] += math.radians(bounds.own_heading) * own[:, 2]
        ships = target_ships(states)
        here = is_present(states)[..., None]
        ships[..., :2] += bounds.ship_position * other[..., :2] * here
        speed = ships[..., SHIP_SPEED] + bounds.ship_speed * other[..., 2]
        ships[..., SHIP_SPEED] = speed.clamp(min=0.0) * here[..., 0]
        return states

    def _is_valid(self, states: Tensor) -> Tensor:
        """Return which states [N, S] keep the safe distance and have a way to go, bool [N]."""
        distance = torch.linalg.vector_norm(relative_positions(states), dim=-1)
        is_clear = (distance >= self.world.safe_distance) | ~is_present(states)
        return is_clear.all(-1) & (goal_distance(states) > self.world.goal_distance)
