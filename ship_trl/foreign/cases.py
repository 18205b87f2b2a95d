"""A situation of another tool as a case of the simulator's size.

Two factors carry a situation over: lengths by the safe distance, speeds by own ship's. Time follows from
both. Angles, classes of encounter, and ratios of speeds and of lengths stay as they are.
"""

from __future__ import annotations

import math
import re

import numpy as np

from ship_trl.config.bounds import MAX_DISTANCE, NAUTICAL_MILE
from ship_trl.config.types import Situations, Targets, World
from ship_trl.formats.situation import Ship, Situation
from ship_trl.sim import cases
from ship_trl.sim.cases import Case, RecordedShip, TargetShip
from ship_trl.sim.scale import Scale

# Of the way that own ship can go straight on in the time of an episode: the rest is for a detour.
USED = 0.7
# What stands for the ideal path, which nobody knows.
FOREIGN = "unknown"
# Where a file has no goal: metres ahead, as in the paper's cases.
GOAL_AHEAD = 600.0
# A faster target ship is told: networks were trained with up to 1.5.
MAX_RATIO = 2.5
# Not in the name of a folder or file.
UNNAMED = re.compile(r"[^\w.-]+")


def to_case(situation: Situation, world: World, reading: Situations, notes: list[str]) -> Case:
    """Return a situation as a case, with its scale; what people should know is added to `notes`.

    Raises:
        ValueError: it has too many target ships, or one that starts too near or too far away.
    """
    straight, _ = world.actions[world.straight_action]
    scale = Scale(
        reading.safe * NAUTICAL_MILE / world.safe_distance,
        situation.own.speed / straight,
        "" if situation.start is None else situation.start.isoformat(sep=" ", timespec="seconds"),
        situation.origin,
    )
    if len(situation.targets) > cases.MAX_TARGET_SHIPS:
        raise ValueError(f"has {len(situation.targets)} target ships; allowed: {cases.MAX_TARGET_SHIPS}")
    ships: list[TargetShip] = []
    for number, ship in enumerate(situation.targets, 1):
        away = math.hypot(ship.x, ship.y) / NAUTICAL_MILE
        farthest = MAX_DISTANCE * scale.length / NAUTICAL_MILE
        if not reading.safe <= away <= farthest:
            allowed = f"the safe distance of {reading.safe:g} NM (situations.safe) to {farthest:.0f} NM"
            raise ValueError(f"target ship {number} starts {away:.2f} NM from own ship; allowed: {allowed}")
        speed = ship.speed / scale.speed
        start = ship.x / scale.length, ship.y / scale.length, cases.to_heading(ship.course), speed
        if reading.targets is Targets.replay and ship.track is not None:
            ships.append(RecordedShip(*start, path=path_of(ship, scale, world)))
        else:
            ships.append(TargetShip(*start))
        if speed > MAX_RATIO * straight:
            notes.append(f"a target ship is more than {MAX_RATIO:g} times as fast as own ship")
    if not ships:
        notes.append("a situation has no target ship")
    course = math.radians(situation.own.course)
    x, y = situation.goal or (math.sin(course), math.cos(course))
    # As far as own ship gets with some steps left for a detour; without a goal, as in the paper's cases.
    most = USED * (straight * world.dt * world.max_steps + world.goal_distance)
    away = math.hypot(x, y)
    distance = GOAL_AHEAD if situation.goal is None else min(away / scale.length, most)
    if situation.goal is not None and away / scale.length > most:
        notes.append("own ship's goal lies farther away than an episode lasts; it is moved nearer")
    goal = [x / away * distance, y / away * distance]
    name = re.sub(UNNAMED, "_", situation.name)[:80]
    return Case(
        [0.0, 0.0],
        cases.to_heading(situation.own.course),
        goal,
        FOREIGN,
        ships,
        name,
        scale,
        path_of(situation.own, scale, world),
    )


def path_of(ship: Ship, scale: Scale, world: World) -> tuple[tuple[float, float], ...]:
    """Return where a ship was (m, of the simulator's size) after each step, as long as its track is known."""
    if ship.track is None:
        return ()
    seconds, x, y = ship.track.T
    times = np.arange(1, world.max_steps + 1) * world.dt * scale.time
    times = times[times <= seconds[-1]]
    places = np.stack((np.interp(times, seconds, x), np.interp(times, seconds, y)), -1) / scale.length
    return tuple((float(east), float(north)) for east, north in places)
