"""Draw the initial states of a suite's episodes.

Environments reset a few rows at nearly every step, so this is NumPy: torch takes ten times as long on them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.sim.state import (
    HEADING,
    SHIP_SPEED,
    SHIP_Y,
    X,
    Y,
    goal,
    initial_state,
    is_present,
    position,
    target_ships,
)
from ship_trl.sim.suites import Suite
from ship_trl.sim.traffic import TrafficStarts, draw_scenes

# Perturbed starts inside the safe distance or at the goal are drawn again, at most this often.
MAX_DRAWS = 1000
# Arrays: states [N, S], and indices of the suite's cases [N].
States = NDArray[np.float32]
Cases = NDArray[np.int64]


class Starts:
    """Draws initial states of a suite. All its random numbers are those of the generator that is passed in.

    Args:
        suite: cases and perturbation.
        world: the actions, and the two distances that a start keeps.

    Attributes:
        states: initial states of the suite's cases, float32 [cases, S].
    """

    def __init__(self, suite: Suite, world: World) -> None:
        self.suite = suite
        self.states = torch.stack([initial_state(case, world, suite.places) for case in suite.cases])
        self._is_perturbed = not suite.perturbation.is_none
        present = is_present(self.states)
        # The largest change of each number, and its least value.
        bounds, least = torch.zeros_like(self.states), torch.full_like(self.states[0], -math.inf)
        position(bounds)[:] = suite.perturbation.own_position
        bounds[:, HEADING] = math.radians(suite.perturbation.own_heading)
        target_ships(bounds)[..., : SHIP_Y + 1] = suite.perturbation.ship_position * present[..., None]
        target_ships(bounds)[..., SHIP_SPEED] = suite.perturbation.ship_speed * present
        target_ships(least)[..., SHIP_SPEED] = 0.0
        self._low, self._width = (self.states - bounds).numpy(), (2 * bounds).numpy()
        self._least = least.numpy()
        # Columns of goal and ships [1 + K, 2], and the distances to keep from them [cases, 1 + K].
        columns = torch.arange(self.states.shape[1], device="cpu")
        points = torch.cat((goal(columns)[None], target_ships(columns)[:, : SHIP_Y + 1]))
        keep = (
            torch.full((len(self.states), 1), world.goal_distance, device="cpu"),
            world.safe_distance * present,
        )
        self._points, self._keep = points.numpy(), torch.cat(keep, 1).numpy()
        # Starts are checked only where the bounds let a ship or the goal come too near.
        reach = math.sqrt(2) * (suite.perturbation.own_position + suite.perturbation.ship_position)
        cases = np.arange(len(self.states))
        self._may_fail = self._is_perturbed and self._find_invalid(self.states.numpy(), cases, reach).size > 0

    def sample(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S] of random cases, as `draw`."""
        return torch.from_numpy(self.draw(count, generator))

    def draw(self, count: int, generator: Generator) -> States:
        """Return initial states [count, S] of random cases. A fixed suite draws no numbers.

        Raises:
            ConfigError: too few perturbed starts keep the safe distance.
        """
        cases = np.zeros(count, np.int64)
        if len(self._low) > 1:
            torch.from_numpy(cases).random_(0, len(self._low), generator=generator)
        return self._begin(cases, generator)

    def balanced(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S] of the cases in turn: row i is of case i modulo their number.

        Raises:
            ConfigError: as `draw`.
        """
        return torch.from_numpy(self._begin(np.arange(count) % len(self._low), generator))

    def _begin(self, cases: Cases, generator: Generator) -> States:
        """Return initial states [N, S] of cases [N]; draw invalid ones again."""
        states = self._perturb(cases, generator)
        if not self._may_fail:
            return states
        for _ in range(MAX_DRAWS):
            invalid = self._find_invalid(states, cases)
            if not invalid.size:
                return states
            states[invalid] = self._perturb(cases[invalid], generator)
        raise ConfigError(
            f"suite {self.suite.name}: perturbation: too large, as nearly every start is inside the safe "
            "distance or at the goal; allowed: smaller bounds"
        )

    def _perturb(self, cases: Cases, generator: Generator) -> States:
        """Return initial states [N, S] of cases [N], perturbed if the suite is."""
        states: States = self._low.take(cases, 0)
        if self._is_perturbed:
            states += self._width.take(cases, 0) * uniform(states.shape, generator)
            np.maximum(states, self._least, out=states)
        return states

    def _find_invalid(self, states: States, cases: Cases, reach: float = 0.0) -> NDArray[np.int64]:
        """Return the rows nearer to a ship or the goal than allowed, by up to `reach` metres."""
        away = states[:, self._points] - states[:, None, X : Y + 1]
        distance = np.hypot(away[..., 0], away[..., 1])
        return (distance < self._keep.take(cases, 0) + reach).any(1).nonzero()[0]


def make_starts(
    suite: Suite, world: World, scenes: Callable[..., bool] = draw_scenes
) -> Starts | TrafficStarts:
    """Make what draws the initial states of a suite, random encounters by `scenes`."""
    return Starts(suite, world) if suite.traffic is None else TrafficStarts(suite.traffic, world, scenes)


def uniform(shape: tuple[int, ...], generator: Generator) -> NDArray[np.float32]:
    """Draw numbers from 0 to 1. Filling an array costs half as much as `torch.rand`."""
    numbers = np.empty(shape, np.float32)
    torch.from_numpy(numbers).uniform_(generator=generator)
    return numbers
