"""Scenarios of NTNU's colav_simulator: YAML with a `ship_list`, own ship first.

A ship's `csog_state` is north, east (m), speed (m/s) and course (degrees clockwise from north). Its
`waypoints` are two rows, all norths then all easts. Own ship's goal is its last waypoint, or the place of
`goal_csog_state`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from ship_trl.config.schema import read_as, rule
from ship_trl.formats.situation import Ship, Situation, notes_on

# Metres of a place in UTM.
Place = Annotated[float, Field(ge=-2e7, le=2e7)]
Speed = Annotated[float, Field(ge=0, le=100)]
Degrees = Annotated[float, Field(ge=-360, le=360)]
State = tuple[Place, Place, Speed, Degrees]


@dataclass
class ShipFile:
    """A ship; other keys are not read."""

    csog_state: State
    goal_csog_state: State | None = None
    waypoints: tuple[list[Place], list[Place]] | None = None


@dataclass
class ScenarioFile:
    """A scenario; other keys are not read."""

    ship_list: Annotated[list[ShipFile], rule("a list of ships, own ship first", bool)]


def read_scenario(values: object, name: str) -> Situation:
    """Read a scenario.

    Raises:
        ValueError, ConfigError: own ship's or a target ship's state is missing or wrong; it names the key.
    """
    ships = read_as(ScenarioFile, values, from_json=True).ship_list
    north, east, _, _ = ships[0].csog_state
    found, paths = [], []
    for place, ship in enumerate(ships):
        y, x, speed, course = ship.csog_state
        found.append(Ship(x - east, y - north, course % 360.0, speed))
        norths, easts = ship.waypoints or ([], [])
        if len(norths) != len(easts):
            raise ValueError(f"ship_list[{place}].waypoints: has {len(norths)} norths and {len(easts)} easts")
        paths.append([(x - east, y - north) for x, y in zip(easts, norths, strict=True)])
    goal = paths[0][-1] if paths[0] else None
    if (wanted := ships[0].goal_csog_state) is not None:
        goal = (wanted[1] - east, wanted[0] - north)
    return Situation(name, found[0], goal, tuple(found[1:]), notes=notes_on(paths[1:]))
