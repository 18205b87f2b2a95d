"""What planners share: remembered encounter classes, and steering a course by actions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.config.bounds import HEAD_ON_DEGREES
from ship_trl.config.types import World
from ship_trl.sim.encounter import Encounter, Motion, classify
from ship_trl.sim.state import STEP, goal, position


def goal_course(state: Tensor) -> Tensor:
    """Return the headings (rad) [...] from own ship to the goal in states [..., S]."""
    east, north = (goal(state) - position(state)).unbind(-1)
    return torch.atan2(north, east)


@dataclass(frozen=True)
class Onset:
    """When an encounter begins and ends. Metres, seconds, degrees.

    An encounter begins when DCPA is below `dcpa` and TCPA between 0 and `tcpa`. It ends when the ships move
    apart and are `clear` away from each other. Between the two its class stays (Rule 13(d)).
    """

    dcpa: float
    tcpa: float
    clear: float
    head_on: float = HEAD_ON_DEGREES


class Encounters:
    """Remembers the encounter class of every place, for rows whose episodes begin at different times."""

    def __init__(self, onset: Onset) -> None:
        self.onset, self.classes = onset, torch.empty(0, 0, dtype=torch.int64)

    def update(self, state: Tensor, motion: Motion) -> Tensor:
        """Return the classes now, int64 [N, K], for states [N, S]; step 0 begins a new episode."""
        onset, classes = self.onset, self.classes
        if classes.shape != motion.distance.shape:
            classes = torch.full_like(motion.distance, Encounter.NONE, dtype=torch.int64)
        is_over = (motion.tcpa < 0) & (motion.distance > onset.clear)
        classes = classes.masked_fill(is_over | (state[:, STEP, None] == 0), Encounter.NONE)
        begins = (classes == Encounter.NONE) & (motion.dcpa < onset.dcpa)
        begins &= (motion.tcpa >= 0) & (motion.tcpa <= onset.tcpa)
        found = classify(motion.bearing, motion.aspect, math.radians(onset.head_on))
        self.classes = torch.where(begins, found, classes)
        return self.classes


class Steering:
    """Chooses the action that brings own ship onto a course at a speed.

    An action that turns at a rate may leave an error of one such turn, so that two opposite actions in turn
    hold a course at the speed of turning: no action is both slow and straight. This rule is ours.

    Attributes:
        deadband: error of the course (rad) that is not steered against.
    """

    def __init__(self, world: World, device: torch.device | str = "cpu", deadband: float = 0.05) -> None:
        actions = torch.tensor(world.actions, device=device)
        self.speed, self.turn = actions[:, 0], actions[:, 1] * world.dt
        self.allowed = self.turn.abs().clamp(min=deadband)

    def __call__(self, error: Tensor, speed: Tensor) -> Tensor:
        """Return action indices, int64 [N].

        Args:
            error: wanted minus present heading (rad) [N].
            speed: wanted speed (m/s) [N].
        """
        left = (error[:, None] - self.turn).abs()
        excess = (left - self.allowed).clamp(min=0.0)
        slower = (self.speed - speed[:, None]).abs()
        # First the course, then the speed, then what is left of the error.
        return (1e4 * excess + 10.0 * slower + left).argmin(-1)
