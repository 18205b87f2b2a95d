"""An episode as a situation, at the scale of its case: to be written for other tools."""

from __future__ import annotations

import math
from datetime import datetime

import numpy as np
from torch import Tensor

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.types import Situations, World
from ship_trl.formats.situation import PLACE, START, Plane, Ship, Situation
from ship_trl.sim import state as col
from ship_trl.sim.cases import Case
from ship_trl.sim.scale import Scale

# Of a case without a scale: that of own ship at this speed (knots).
KNOTS = 12.0


def situation_of(case: Case, states: Tensor, world: World) -> Situation:
    """Return an episode, states [T, S], at the scale of its case as a situation with tracks."""
    straight = world.actions[world.straight_action][0]
    usual = Scale(Situations().safe * NAUTICAL_MILE / world.safe_distance, KNOTS * KNOT / straight)
    scale = case.scale or usual
    start = datetime.fromisoformat(scale.start) if scale.start else START
    seconds = np.arange(len(states)) * world.dt * scale.time
    states = states.double()
    count = int(states[0, col.SHIP_COUNT])
    own = states[:, [col.X, col.Y, col.HEADING, col.SPEED]]
    others = col.target_ships(states)[:, :count, [col.SHIP_X, col.SHIP_Y, col.SHIP_HEADING, col.SHIP_SPEED]]
    ships = []
    for rows in (own, *others.unbind(1)):
        x, y = (rows[:, :2] - own[0, :2]).numpy().T * scale.length
        course = (90.0 - math.degrees(float(rows[0, 2]))) % 360.0
        track = np.stack((seconds, x, y), -1)
        ships.append(Ship(float(x[0]), float(y[0]), course, float(rows[0, 3]) * scale.speed, track))
    place = Plane(*scale.place) if scale.place else PLACE
    goal = [scale.length * (end - float(begin)) for end, begin in zip(case.goal, own[0, :2], strict=True)]
    return Situation(case.name, ships[0], (goal[0], goal[1]), tuple(ships[1:]), place, start)
