"""Write an episode for other tools: as a traffic situation, or as AIS positions in a form of MarineCadastre.

Ships are numbered, own ship is 1: no name, call sign or MMSI of a real ship is written.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

import numpy as np
from torch import Tensor

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.types import Situations, World
from ship_trl.formats.situation import Plane, Ship, Situation
from ship_trl.sim import state as layout
from ship_trl.sim.cases import Case
from ship_trl.sim.scale import Scale

# Where a case has no time and place: its scale is that of own ship at this speed (knots).
KNOTS, START, PLACE = 12.0, datetime(2025, 1, 1, tzinfo=UTC), (0.0, 0.0)
# Seconds between rows of a table, as class A sends them at most speeds; the first number of its ships.
AIS_SECONDS, FIRST_MMSI = 10, 200_000_000
AIS_COLUMNS = (
    "mmsi,base_date_time,longitude,latitude,sog,cog,heading,vessel_name,imo,call_sign,vessel_type,status,"
    "length,width,draft,cargo,transceiver"
)


def situation_of(case: Case, states: Tensor, world: World) -> Situation:
    """Return an episode, states [T, S], at the scale of its case as a situation with tracks."""
    straight = world.actions[world.straight_action][0]
    usual = Scale(Situations().safe * NAUTICAL_MILE / world.safe_distance, KNOTS * KNOT / straight)
    scale = case.scale or usual
    start = datetime.fromisoformat(scale.start) if scale.start else START
    seconds = np.arange(len(states)) * world.dt * scale.time
    states = states.double()
    count = int(states[0, layout.SHIP_COUNT])
    own = states[:, [layout.X, layout.Y, layout.HEADING, layout.SPEED]]
    others = layout.target_ships(states)[
        :, :count, [layout.SHIP_X, layout.SHIP_Y, layout.SHIP_HEADING, layout.SHIP_SPEED]
    ]
    ships = []
    for rows in (own, *others.unbind(1)):
        x, y = (rows[:, :2] - own[0, :2]).numpy().T * scale.length
        course = (90.0 - math.degrees(float(rows[0, 2]))) % 360.0
        track = np.stack((seconds, x, y), -1)
        ships.append(Ship(float(x[0]), float(y[0]), course, float(rows[0, 3]) * scale.speed, track))
    place = Plane(*(scale.place or PLACE))
    goal = [scale.length * (end - float(begin)) for end, begin in zip(case.goal, own[0, :2], strict=True)]
    return Situation(case.name, ships[0], (goal[0], goal[1]), tuple(ships[1:]), place, start)


def write_ais(situation: Situation) -> str:
    """Return the tracks of a situation as a table of AIS positions, sorted by time; see `AIS_COLUMNS`."""
    plane, start = Plane(*(situation.origin or PLACE)), situation.start or START
    rows = []
    for number, ship in enumerate((situation.own, *situation.targets), 1):
        assert ship.track is not None
        seconds, x, y = ship.track.T
        # Whole seconds, as stamps have; a ship keeps its course within a step.
        times = np.arange(0, int(seconds[-1]) + 1, AIS_SECONDS)
        steps = np.searchsorted(seconds, times, side="right").clip(max=len(seconds) - 1) - 1
        latitudes, longitudes = plane.to_degrees(np.interp(times, seconds, x), np.interp(times, seconds, y))
        speeds = np.hypot(np.diff(x), np.diff(y)) / np.diff(seconds) / KNOT
        courses = np.degrees(np.arctan2(np.diff(x), np.diff(y))).round(1) % 360.0
        for second, latitude, longitude, step in zip(
            times.tolist(), latitudes, longitudes, steps, strict=True
        ):
            stamp = (start + timedelta(seconds=second)).strftime("%Y-%m-%d %H:%M:%S")
            place = f"{longitude:.6f},{latitude:.6f},{speeds[step]:.1f},{courses[step]:.1f}"
            rows.append((second, number, f"{FIRST_MMSI + number},{stamp},{place},,,,,,0,,,,,A"))
    return "\n".join((AIS_COLUMNS, *(row for _, _, row in sorted(rows)), ""))
