"""What planners and metrics share: relative motion, encounter classes, and steering a course by actions.

Bearings here are clockwise from the bow in radians, starboard positive, as the rules count them; headings and
rates of turn are counter-clockwise, as everywhere in the package.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.encounters import HEAD_ON, Encounter, classify
from ship_trl.sim.geometry import angle_off_bow, predicted_approach, unit_vector
from ship_trl.sim.state import (
    HEADING,
    SHIP_HEADING,
    SHIP_SPEED,
    SPEED,
    STEP,
    goal,
    is_present,
    position,
    relative_positions,
    target_ships,
)


class Motion(NamedTuple):
    """Target ships as own ship sees them; places without a ship hold infinite distances.

    Shapes: position (m) and velocity (m/s) relative to own ship [..., K, 2]; distance, dcpa (m) and tcpa (s)
    [..., K]; `bearing` of the target ship from own ship and `aspect`, the bearing of own ship from the target
    ship, [..., K].
    """

    position: Tensor
    velocity: Tensor
    distance: Tensor
    dcpa: Tensor
    tcpa: Tensor
    bearing: Tensor
    aspect: Tensor


def own_velocity(state: Tensor) -> Tensor:
    """Return own ship's velocities (m/s) [..., 2] in states [..., S]."""
    return state[..., SPEED, None] * unit_vector(state[..., HEADING])


def ship_velocities(state: Tensor) -> Tensor:
    """Return the target ships' velocities (m/s) [..., K, 2] in states [..., S]."""
    ships = target_ships(state)
    return ships[..., SHIP_SPEED, None] * unit_vector(ships[..., SHIP_HEADING])


def goal_course(state: Tensor) -> Tensor:
    """Return the headings (rad) [...] from own ship to the goal in states [..., S]."""
    east, north = (goal(state) - position(state)).unbind(-1)
    return torch.atan2(north, east)


def relative_motion(state: Tensor) -> Motion:
    """Return how the target ships move relative to own ship, for states [..., S]."""
    away, ships, present = relative_positions(state), target_ships(state), is_present(state)
    velocity = ship_velocities(state) - own_velocity(state)[..., None, :]
    dcpa, tcpa = predicted_approach(away, velocity)
    own = position(state)[..., None, :]
    return Motion(
        away,
        velocity,
        torch.linalg.vector_norm(away, dim=-1).masked_fill(~present, math.inf),
        dcpa.masked_fill(~present, math.inf),
        tcpa,
        -angle_off_bow(own, state[..., HEADING, None], own + away),
        -angle_off_bow(own + away, ships[..., SHIP_HEADING], own),
    )


@dataclass(frozen=True)
class Onset:
    """When an encounter begins and ends. Metres, seconds, degrees.

    An encounter begins when DCPA is below `dcpa` and TCPA between 0 and `tcpa`. It ends when the ships move
    apart and are `clear` away from each other. Between the two its class stays (Rule 13(d)).
    """

    dcpa: float
    tcpa: float
    clear: float
    head_on: float = HEAD_ON


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
