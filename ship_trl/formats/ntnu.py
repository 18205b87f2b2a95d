"""Scenarios of NTNU's colav_simulator: YAML with a `ship_list`, own ship first.

A ship's `csog_state` is north, east (m), speed (m/s) and course (degrees clockwise from north). Its
`waypoints` are two rows, all norths then all easts. Own ship's goal is its last waypoint, or the place of
`goal_csog_state`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ship_trl.formats.situation import (
    TURNS,
    Ship,
    Situation,
    number_of,
    refuse_impossible,
    turns_at_a_waypoint,
)

# Metres of a place in UTM, and m/s.
MAX_PLACE, MAX_SPEED = 2e7, 100.0


def is_scenario(values: object) -> bool:
    """Return whether YAML values hold a scenario."""
    return isinstance(values, Mapping) and "ship_list" in values


def read_scenario(values: Mapping[str, Any], name: str) -> Situation:
    """Read a scenario.

    Raises:
        ValueError: own ship's or a target ship's state is missing or wrong; it names the key.
    """
    ships = values["ship_list"]
    if not isinstance(ships, list) or not ships or not all(isinstance(ship, Mapping) for ship in ships):
        raise ValueError("ship_list: must be a list of ships, own ship first")
    north, east, _, _ = read_state(ships[0].get("csog_state"), "ship_list[0].csog_state")
    found = []
    for place, ship in enumerate(ships):
        y, x, speed, course = read_state(ship.get("csog_state"), f"ship_list[{place}].csog_state")
        found.append(Ship(x - east, y - north, course % 360.0, speed))
    goal = None
    if (wanted := ships[0].get("goal_csog_state")) is not None:
        y, x, *_ = read_state(wanted, "ship_list[0].goal_csog_state")
        goal = (x - east, y - north)
    elif places := places_of(ships[0], 0):
        goal = (places[-1][0] - east, places[-1][1] - north)
    turns = any(turns_at_a_waypoint(places_of(ship, place)) for place, ship in enumerate(ships) if place)
    return refuse_impossible(Situation(name, found[0], goal, tuple(found[1:]), notes=(TURNS,) * turns))


def read_state(values: object, where: str) -> tuple[float, float, float, float]:
    """Return north, east (m), speed (m/s) and course (degrees) of a `csog_state`."""
    if not isinstance(values, list) or len(values) != 4:
        raise ValueError(f"{where}: must be [north, east, speed in m/s, course in degrees]")
    north, east, speed, course = values
    return (
        number_of(north, -MAX_PLACE, MAX_PLACE, where),
        number_of(east, -MAX_PLACE, MAX_PLACE, where),
        number_of(speed, 0, MAX_SPEED, where),
        number_of(course, -360, 360, where),
    )


def places_of(ship: Mapping[str, Any], place: int) -> list[tuple[float, float]]:
    """Return a ship's waypoints as east and north (m); none if the file has none."""
    where = f"ship_list[{place}].waypoints"
    if (rows := ship.get("waypoints")) is None:
        return []
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows) or len(rows) != 2:
        raise ValueError(f"{where}: must be two rows, all norths then all easts")
    norths, easts = ([number_of(one, -MAX_PLACE, MAX_PLACE, where) for one in row] for row in rows)
    if len(norths) != len(easts):
        raise ValueError(f"{where}: has {len(norths)} norths and {len(easts)} easts")
    return list(zip(easts, norths, strict=True))
