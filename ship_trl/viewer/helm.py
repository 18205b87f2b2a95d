"""A ship that a person steers: an action of table 1 for each step, chosen while the one before is sailed."""

from __future__ import annotations

import torch

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.transition import Transition
from ship_trl.viewer.telemetry import Telemetry, measure


class Helm:
    """An episode that is being sailed. The rudder stays where it was put.

    `rudder` is the index of the action that the next step takes; actions are in the order of their rate of
    turn, from port to starboard, as in table 1. `sailed` is the world after every step, in `telemetry`.
    """

    def __init__(self, case: Case, world: World) -> None:
        self.case, self.world = case, world
        self._motion = Transition(case, world, torch.device("cpu"))
        self.restart()

    def restart(self) -> None:
        """Begin again, on a straight course."""
        turns = [turn for _, turn in self.world.actions]
        # From port to starboard.
        self.order = sorted(range(len(turns)), key=lambda k: -turns[k])
        self.rudder = min(range(len(turns)), key=lambda k: (abs(turns[k]), -self.world.actions[k][0]))
        self._straight = self.rudder
        self._states = [self._motion.start[None]]
        self._actions: list[int] = []
        self.telemetry = self._measure()

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return self.telemetry.outcome is not None

    def turn(self, notches: int) -> None:
        """Put the rudder so many actions to starboard (to port if negative), as far as there are any."""
        place = self.order.index(self.rudder) + notches
        self.rudder = self.order[min(max(place, 0), len(self.order) - 1)]

    def midships(self) -> None:
        """Keep the course."""
        self.rudder = self._straight

    def put(self, action: int) -> None:
        """Put the rudder to an action by its index; one that there is not changes nothing."""
        if 0 <= action < len(self.world.actions):
            self.rudder = action

    def step(self) -> Telemetry:
        """Sail one step by the rudder as it is; returns the episode so far."""
        if not self.over:
            after = self._motion(self._states[-1], torch.tensor([self.rudder]))
            self._states.append(after.state)
            self._actions.append(self.rudder)
            self.telemetry = self._measure()
        return self.telemetry

    @property
    def actions(self) -> list[int]:
        """What was chosen so far, one index a step."""
        return list(self._actions)

    def _measure(self) -> Telemetry:
        actions = torch.tensor(self._actions, dtype=torch.int64)
        return measure(self.case, self.world, torch.cat(self._states), actions)
