"""`sim.encounter.Tracker` as a compiled loop; tests compare the two."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ship_trl.fast.jit import compiled
from ship_trl.fast.step import bearing_of
from ship_trl.sim import encounter
from ship_trl.sim import state as col
from ship_trl.sim.encounter import LEAST_APPROACH, SPEED_CHANGE, TURN, Encounter

Array = np.ndarray[Any, Any]
# Place (m) and velocity (m/s) of a ship relative to own ship, and the numbers of `sim.encounter.Limits`.
Motion = tuple[float, float, float, float]
Limits = tuple[float, float, float, float]
NONE, HEAD_ON, GIVE_WAY, STAND_ON, _, OVERTAKEN = map(int, Encounter)
TURN_LOW, TURN_WIDTH = TURN[0], TURN[1] - TURN[0]
SPEED_LOW, SPEED_WIDTH = SPEED_CHANGE[0], SPEED_CHANGE[1] - SPEED_CHANGE[0]


@compiled()
def share(value: float, low: float, width: float) -> float:
    """Return `sim.encounter.ramp` of a value."""
    return min(max((value - low) / width, 0.0), 1.0) ** 2


@compiled()
def begins_as(away: Motion, time: float, heading: float, course: float, speed: float, limits: Limits) -> int:
    """Return the class of an encounter that begins now, or none.

    Args:
        away: the ship's motion.
        time: TCPA (s).
        heading: own heading (rad).
        course: the ship's heading (rad).
        speed: the ship's speed (m/s).
        limits: when it begins.
    """
    dcpa, tcpa, _, head_on = limits
    x, y, velocity_x, velocity_y = away
    is_ruled = speed > 0 and math.hypot(velocity_x, velocity_y) > LEAST_APPROACH
    if (
        not is_ruled
        or not 0 <= time <= tcpa
        or math.hypot(x + time * velocity_x, y + time * velocity_y) >= dcpa
    ):
        return NONE
    return int(encounter.classify(bearing_of(x, y, heading), bearing_of(-x, -y, course), head_on))


@compiled()
def action_of(kind: int, turned: float, slowed: float) -> float:
    """Return `sim.encounter.action_size` of a turn to starboard (rad) and a change of speed."""
    turned -= 2 * math.pi * math.floor((turned + math.pi) / (2 * math.pi))
    if kind not in (HEAD_ON, GIVE_WAY):
        turned = abs(turned)
    turn = share(math.degrees(turned), TURN_LOW, TURN_WIDTH)
    slow = share(slowed, SPEED_LOW, SPEED_WIDTH)
    return max(turn, slow) if kind in (STAND_ON, OVERTAKEN) else (turn + slow) / 2


@compiled()
def track_ship(row: Array, ship: int, cruise: float, limits: Limits) -> None:
    """Write class, onset and action of the ship whose numbers begin at `ship` in a state [S]."""
    slowed, onset = abs(row[col.SPEED] / cruise - 1), row[ship + col.SHIP_ONSET_HEADING]
    course, speed = row[ship + col.SHIP_HEADING], row[ship + col.SHIP_SPEED]
    x, y = row[ship + col.SHIP_X] - row[col.X], row[ship + col.SHIP_Y] - row[col.Y]
    velocity_x = speed * math.cos(course) - row[col.SPEED] * math.cos(row[col.HEADING])
    velocity_y = speed * math.sin(course) - row[col.SPEED] * math.sin(row[col.HEADING])
    speed2 = velocity_x * velocity_x + velocity_y * velocity_y
    time = -(x * velocity_x + y * velocity_y) / speed2 if speed2 > 0 else 0.0
    kind = int(row[ship + col.SHIP_CLASS])
    moves_apart = x * (speed * math.cos(course) - cruise * math.cos(onset)) + y * (
        speed * math.sin(course) - cruise * math.sin(onset)
    )
    if row[col.STEP] == 0 or (time < 0 and moves_apart > 0 and math.hypot(x, y) > limits[2]):
        kind = NONE
    if kind != NONE:
        action = action_of(kind, onset - row[col.HEADING], slowed)
        row[ship + col.SHIP_ACTION] = max(row[ship + col.SHIP_ACTION], action)
        return
    kind = begins_as((x, y, velocity_x, velocity_y), time, row[col.HEADING], course, speed, limits)
    row[ship + col.SHIP_CLASS], row[ship + col.SHIP_ACTION] = kind, 0.0
    row[ship + col.SHIP_ONSET] = row[col.STEP] if kind != NONE else 0.0
    row[ship + col.SHIP_ONSET_HEADING] = row[col.HEADING] if kind != NONE else 0.0


@compiled()
def track(before: Array, after: Array, dt: float, cruise: float, limits: Limits) -> None:
    """Write what has happened to each target ship into states [N, S] after a step; see `Tracker`."""
    for n in range(after.shape[0]):
        row = after[n]
        for k in range(int(row[col.SHIP_COUNT])):
            ship = col.OWN_SIZE + col.SHIP_SIZE * k
            swung = row[ship + col.SHIP_HEADING] - before[n, ship + col.SHIP_HEADING]
            swung -= 2 * math.pi * math.floor((swung + math.pi) / (2 * math.pi))
            row[ship + col.SHIP_TURN] = swung / dt
            track_ship(row, ship, cruise, limits)


class CompiledTracker:
    """`Tracker` as a compiled loop on the CPU: `track(before, after)` maps float32 [N, S] to [N, S]."""

    def __init__(self, reference: encounter.Tracker) -> None:
        self._constants = reference.world.dt, reference.cruise, tuple(reference.limits)

    def into(self, before: Array, after: Array) -> None:
        """Write into the states after a step."""
        track(before, after, *self._constants)

    def __call__(self, before: Tensor, after: Tensor) -> Tensor:
        """Return the states after a step."""
        state = after.clone(memory_format=torch.contiguous_format)
        self.into(before.contiguous().numpy(), state.numpy())
        return state
