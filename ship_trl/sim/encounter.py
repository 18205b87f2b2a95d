"""How ships move relative to each other, and what the steering rules ask of them (Rules 13 to 15).

Bearings here are clockwise from the bow in radians, starboard positive, as the rules count them; headings and
rates of turn are counter-clockwise, as everywhere in the package. The sectors are Pedersen's (2023, as in
DNV's traffic generator). They say what the rules would ask, not whether there is a risk of collision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.bounds import HEAD_ON_DEGREES
from ship_trl.config.types import World
from ship_trl.sim import state as col
from ship_trl.sim.geometry import angle_off_bow, predicted_approach, unit_vector, wrap_angle
from ship_trl.sim.state import is_present, position, relative_positions, target_ships

# Tensors in torch, numbers in compiled loops. Only operations that both share are allowed.
Angle = Any
Flag = Any
# A number in compiled loops, of their own precision.
Number = Any

# Half of the sector in which ships meet head-on.
HEAD_ON = math.radians(HEAD_ON_DEGREES)
# Rule 13: a ship that comes up from more than 22.5 degrees abaft the beam overtakes.
ABAFT_BEAM = math.radians(112.5)
# Pedersen 2023: the overtaken ship is at most this far off the overtaker's bow.
AHEAD = math.radians(67.5)

# M/s. Slower, ships come 3 m nearer in half a minute.
LEAST_APPROACH = 0.1


class Encounter(IntEnum):
    """What the rules ask of own ship towards one target ship."""

    NONE = 0
    HEAD_ON = 1
    GIVE_WAY = 2
    STAND_ON = 3
    OVERTAKING = 4
    OVERTAKEN = 5


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
    return state[..., col.SPEED, None] * unit_vector(state[..., col.HEADING])


def ship_velocities(state: Tensor) -> Tensor:
    """Return the target ships' velocities (m/s) [..., K, 2] in states [..., S]."""
    ships = target_ships(state)
    return ships[..., col.SHIP_SPEED, None] * unit_vector(ships[..., col.SHIP_HEADING])


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
        -angle_off_bow(own, state[..., col.HEADING, None], own + away),
        -angle_off_bow(own + away, ships[..., col.SHIP_HEADING], own),
    )


def are_ruled(state: Tensor, motion: Motion) -> Tensor:
    """Return for which target ships own ship is in an encounter that the rules judge, bool [..., K].

    A ship at anchor goes nowhere, whatever its heading, and ships that move alike do not approach. How ships
    react is not asked here.
    """
    under_way = target_ships(state)[..., col.SHIP_SPEED] > 0
    return under_way & (torch.linalg.vector_norm(motion.velocity, dim=-1) > LEAST_APPROACH)


def bearing_of(x: Number, y: Number, heading: Number) -> Number:
    """Return the bearing (rad) of the point (x, y) off a heading, clockwise in [-pi, pi)."""
    bearing = heading - math.atan2(y, x)
    turns = np.float32(math.floor((bearing + np.float32(math.pi)) / np.float32(2 * math.pi)))
    return bearing - np.float32(2 * math.pi) * turns


def meets(bearing: Angle, aspect: Angle, head_on: float = HEAD_ON) -> Flag:
    """Return whether two ships meet head-on.

    Args:
        bearing: of the other ship from a ship, clockwise (rad).
        aspect: of the ship from the other one, likewise.
        head_on: half-angle (rad) of the head-on sector.
    """
    return (abs(bearing) <= head_on) & (abs(aspect) <= head_on)


def crosses(bearing: Angle, aspect: Angle, head_on: float = HEAD_ON) -> Flag:
    """Return whether a ship crosses with the other one on its starboard side; arguments as `meets`."""
    return (bearing > 0) & (bearing < ABAFT_BEAM) & (aspect > -ABAFT_BEAM) & (aspect <= head_on)


def overtakes(bearing: Angle, aspect: Angle) -> Flag:
    """Return whether a ship overtakes the other one; arguments as `meets`."""
    return (abs(aspect) > ABAFT_BEAM) & (abs(bearing) < AHEAD)


def must_give_way(bearing: Angle, aspect: Angle) -> Flag:
    """Return whether the rules ask a ship to keep out of the way of the other one; arguments as `meets`."""
    return meets(bearing, aspect) | crosses(bearing, aspect) | overtakes(bearing, aspect)


def classify(bearing: Any, aspect: Any, head_on: float = HEAD_ON) -> Any:
    """Return what the rules ask of own ship, encounter classes int64 [...].

    Args:
        bearing: of the target ship from own ship, clockwise (rad) [...]; a tensor or an array.
        aspect: bearing of own ship from the target ship, likewise.
        head_on: half-angle (rad) of the head-on sector.
    """
    head_ons = meets(bearing, aspect, head_on)
    gives_way = crosses(bearing, aspect, head_on) & ~head_ons
    return (
        Encounter.HEAD_ON * head_ons
        + Encounter.GIVE_WAY * gives_way
        + Encounter.STAND_ON * (crosses(aspect, bearing, head_on) & ~head_ons & ~gives_way)
        + Encounter.OVERTAKING * overtakes(bearing, aspect)
        + Encounter.OVERTAKEN * overtakes(aspect, bearing)
    )


def keeps_clear(kind: Tensor) -> Tensor:
    """Return whether classes of encounter ask own ship to keep clear."""
    return (kind == Encounter.HEAD_ON) | (kind == Encounter.GIVE_WAY) | (kind == Encounter.OVERTAKING)


def turns_starboard(kind: Tensor) -> Tensor:
    """Return whether classes of encounter ask own ship to keep clear by a turn to starboard."""
    return (kind == Encounter.HEAD_ON) | (kind == Encounter.GIVE_WAY)


def turn_since_onset(state: Tensor) -> Tensor:
    """Return how far own ship has turned to port since the onset of encounters (rad) [..., K]."""
    return wrap_angle(state[..., col.HEADING, None] - target_ships(state)[..., col.SHIP_ONSET_HEADING])


def stands_on(kind: Tensor) -> Tensor:
    """Return whether classes of encounter ask own ship to keep course and speed."""
    return (kind == Encounter.STAND_ON) | (kind == Encounter.OVERTAKEN)


class Limits(NamedTuple):
    """When an encounter begins and ends.

    It begins when DCPA is below `dcpa` (m) and TCPA between 0 and `tcpa` (s). It ends when the ship is past
    (`are_past`) and `clear` (m) away. `head_on` is the half-angle (rad) of the head-on sector.
    """

    dcpa: float
    tcpa: float
    clear: float
    head_on: float


def limits_of(safe_distance: float, head_on: float = HEAD_ON) -> Limits:
    """Return when an encounter begins and ends, by the world's safe distance (m)."""
    return Limits(safe_distance * 4 / 3, 30.0, 2 * safe_distance, head_on)


def classes_at_onset(state: Tensor, motion: Motion, limits: Limits) -> Tensor:
    """Return the classes of encounters that begin in states, int64 [..., K]; `NONE` where none does."""
    begins = (motion.dcpa < limits.dcpa) & are_ruled(state, motion)
    begins &= (motion.tcpa >= 0) & (motion.tcpa <= limits.tcpa)
    return classify(motion.bearing, motion.aspect, limits.head_on).masked_fill(~begins, Encounter.NONE)


def are_past(state: Tensor, motion: Motion, cruise: float) -> Tensor:
    """Return which target ships move apart from own ship now, and would if it resumed its course [..., K].

    That is the course at the onset, at cruising speed: a hard turn away alone ends no encounter (Rule 13(d)).

    Args:
        state: with the courses that `Tracker` remembers.
        motion: of these states.
        cruise: own speed on that course (m/s).
    """
    course = target_ships(state)[..., col.SHIP_ONSET_HEADING]
    resumed = ship_velocities(state) - cruise * unit_vector(course)
    return (motion.tcpa < 0) & ((motion.position * resumed).sum(-1) > 0)


def cruise_of(world: World) -> float:
    """Return the speed of going straight (m/s), which is never 0."""
    return max(world.actions[world.straight_action][0], 1e-6)


def ramp(value: Any, bounds: tuple[float, float], power: int = 2) -> Any:
    """Return 0 below the first bound and 1 above the second, and the power of the share between."""
    low, high = bounds
    return ((value - low) / (high - low)).clip(0.0, 1.0) ** power


# Maps states [N, S] before and after a step to those after it, with what has happened.
Track = Callable[[Tensor, Tensor], Tensor]


class Tracker:
    """Writes into states what has happened to each target ship: `track(before, after)`, [N, S] each.

    The rate of turn in the step; the class of encounter, which stays from its onset to its end; step and own
    heading at the onset; and the action: how much own ship has changed course (to starboard where it meets
    or gives way) and speed since then, at most, as the rules' scores count it (`sim.rules`).

    At the start of an episode both arguments are its first states.
    """

    def __init__(self, world: World, device: torch.device | str = "cpu") -> None:
        self.device = torch.device(device)
        self.world, self.limits = world, limits_of(world.safe_distance)
        self.cruise = cruise_of(world)

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        """Return the states after the step, float32 [N, S]; none is changed."""
        state = after.clone()
        ships, present = target_ships(state), is_present(state)
        if not ships.shape[-2]:
            return state
        had, motion = ships[..., col.SHIP_CLASS].long(), relative_motion(state)
        # Between its onset and its end a class stays (Rule 13(d)); step 0 begins a new episode.
        is_over = are_past(state, motion, self.cruise) & (motion.distance > self.limits.clear)
        is_over |= state[..., col.STEP, None] == 0
        goes_on = (had != Encounter.NONE) & ~is_over
        now = had.where(goes_on, classes_at_onset(state, motion, self.limits))
        begins = (now != Encounter.NONE) & ~goes_on
        step, heading = (state[..., column, None].expand_as(had) for column in (col.STEP, col.HEADING))
        onset = torch.where(begins, step, ships[..., col.SHIP_ONSET] * goes_on)
        course = torch.where(begins, heading, ships[..., col.SHIP_ONSET_HEADING] * goes_on)
        ships[..., col.SHIP_ONSET_HEADING] = course * present
        turned = -torch.rad2deg(turn_since_onset(state))
        slowed = (state[..., col.SPEED, None] / self.cruise - 1).abs().expand_as(turned)
        action = action_size(now, turned, slowed)
        action = torch.maximum(action, ships[..., col.SHIP_ACTION]) * goes_on
        swung = (
            wrap_angle(ships[..., col.SHIP_HEADING] - target_ships(before)[..., col.SHIP_HEADING])
            / self.world.dt
        )
        for column, value in (
            (col.SHIP_TURN, swung),
            (col.SHIP_CLASS, now),
            (col.SHIP_ONSET, onset),
            (col.SHIP_ACTION, action),
        ):
            ships[..., column] = value * present
        return state


# A change of course (degrees) or speed (shares) counts from the first bound, and in full at the second.
TURN, SPEED_CHANGE = (2.0, 30.0), (0.07, 0.25)


def action_size(kind: Tensor, turned: Tensor, slowed: Tensor) -> Tensor:
    """Return how large an action is, from 0 to 1, towards ships in encounters of a class [...].

    Where own ship keeps clear, the mean of its changes of course and speed; where it stands on, the larger.

    Args:
        kind: classes, int64 [...].
        turned: change of course (degrees), positive to starboard.
        slowed: change of speed, as a share.
    """
    turn = ramp(torch.where(turns_starboard(kind), turned, turned.abs()), TURN)
    speed = ramp(slowed, SPEED_CHANGE)
    return torch.where(stands_on(kind), torch.maximum(turn, speed), (turn + speed) / 2)
