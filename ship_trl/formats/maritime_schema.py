"""Traffic situations: JSON of the maritime schema 0.2.0, as DNV's `trafficgen` and others write it.

Positions are degrees, courses degrees clockwise from north, speeds knots. Waypoint 1 describes the leg from
waypoint 0 to 1, as in RTZ route plans. The package `maritime-schema` 0.0.7 wrote `latitude` and `longitude`
in place of `lat` and `lon`; each position is read by the words that it has.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from ship_trl.config.bounds import KNOT
from ship_trl.formats.situation import (
    MAX_LATITUDE,
    TURNS,
    Plane,
    Ship,
    Situation,
    course_to,
    number_of,
    refuse_impossible,
    turns_at_a_waypoint,
)

SCHEMA_VERSION = "0.2.0"
# The fastest speed that an AIS message can hold is 102.2 knots.
MAX_KNOTS = 102.2
Json = Mapping[str, Any]


def is_situation(values: object) -> bool:
    """Return whether JSON values hold a traffic situation."""
    return isinstance(values, Mapping) and "ownShip" in values


def read_situation(values: Json, name: str) -> Situation:
    """Read a traffic situation.

    Raises:
        ValueError: a ship's position, course or speed is missing or wrong; it names the key.
    """
    own_ship = mapping(values["ownShip"], "ownShip")
    targets = values.get("targetShips", values.get("targetShip")) or ()
    if not isinstance(targets, Sequence) or isinstance(targets, str):
        raise ValueError("targetShips: must be a list")
    plane = Plane(*position_of(own_ship, "ownShip"))
    own, goal, _ = read_ship(own_ship, plane, "ownShip")
    ships: list[Ship] = []
    notes: tuple[str, ...] = ()
    for place, target in enumerate(targets):
        where = f"targetShips[{place}]"
        ship, _, turns = read_ship(mapping(target, where), plane, where)
        ships.append(ship)
        notes = (TURNS,) if turns else notes
    start = read_time(values.get("startTime"))
    return refuse_impossible(Situation(name, own, goal, tuple(ships), plane, start, notes))


def mapping(values: object, where: str) -> Json:
    """Return the values if they are a mapping, or raise a ValueError."""
    if not isinstance(values, Mapping):
        raise ValueError(f"{where}: must be a mapping")
    return values


def read_time(text: object) -> datetime | None:
    """Return a time in UTC; one without a time zone is taken as UTC."""
    if text is None:
        return None
    try:
        time = datetime.fromisoformat(str(text))
        return time.astimezone(UTC) if time.tzinfo else time.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise ValueError(f"startTime: must be a time as 2025-06-15T08:30:00Z, got {text!r:.40}") from None


def position_of(ship: Json, where: str) -> tuple[float, float]:
    """Return a ship's latitude and longitude at the start, `initial` before the first waypoint."""
    initial, waypoints = mapping(ship.get("initial") or {}, f"{where}.initial"), waypoints_of(ship, where)
    if "position" in initial:
        return read_position(initial["position"], f"{where}.initial.position")
    if waypoints:
        return read_position(waypoints[0].get("position"), f"{where}.waypoints[0].position")
    raise ValueError(f"{where}: has no position; wanted: initial.position or waypoints")


def waypoints_of(ship: Json, where: str) -> list[Json]:
    """Return a ship's waypoints, none if the file has none."""
    waypoints = ship.get("waypoints") or []
    if not isinstance(waypoints, list):
        raise ValueError(f"{where}.waypoints: must be a list")
    return [mapping(point, f"{where}.waypoints[{n}]") for n, point in enumerate(waypoints)]


def read_position(values: object, where: str) -> tuple[float, float]:
    """Return latitude and longitude (degrees) of either spelling."""
    position = mapping(values, where)
    long_names = "latitude" in position
    latitude, longitude = ("latitude", "longitude") if long_names else ("lat", "lon")
    return (
        number_of(position.get(latitude), -MAX_LATITUDE, MAX_LATITUDE, f"{where}.{latitude}"),
        number_of(position.get(longitude), -180, 180, f"{where}.{longitude}"),
    )


def read_ship(ship: Json, plane: Plane, where: str) -> tuple[Ship, tuple[float, float] | None, bool]:
    """Return a ship at the start, its last waypoint (m, None if there is none), and whether it turns at one.

    Its course is `initial.cog`, else the way to its second waypoint, else its heading. Its speed is
    `initial.sog`, else that of the first leg, whose `data.sog` counts before its `sog`.
    """
    initial, waypoints = mapping(ship.get("initial") or {}, f"{where}.initial"), waypoints_of(ship, where)
    x, y = (float(way) for way in plane.to_metres(*position_of(ship, where)))
    places: list[tuple[float, float]] = [
        plane.to_metres(*read_position(point.get("position"), f"{where}.waypoints[{n}].position"))
        for n, point in enumerate(waypoints)
    ]
    if len(places) > 1 and places[0] == places[1]:
        raise ValueError(f"{where}.waypoints[1]: is the same place as waypoints[0]")
    course: float
    if (cog := initial.get("cog")) is not None:
        course = number_of(cog, 0, 360, f"{where}.initial.cog")
    elif len(places) > 1:
        course = course_to(places[1][0] - places[0][0], places[1][1] - places[0][1])
    elif (heading := initial.get("heading")) is not None:
        course = number_of(heading, 0, 360, f"{where}.initial.heading")
    else:
        raise ValueError(f"{where}: has no course; wanted: initial.cog or two waypoints")
    knots = initial.get("sog")
    for n in (1, 0):
        if knots is None and n < len(waypoints):
            leg = mapping(waypoints[n].get("leg") or {}, f"{where}.waypoints[{n}].leg")
            data = mapping(leg.get("data") or {}, f"{where}.waypoints[{n}].leg.data").get("sog")
            knots = data.get("value") if isinstance(data, Mapping) else leg.get("sog")
    if knots is None:
        raise ValueError(f"{where}: has no speed; wanted: initial.sog or waypoints[1].leg.sog")
    speed = KNOT * number_of(knots, 0, MAX_KNOTS, f"{where}: speed in knots")
    goal = (float(places[-1][0]), float(places[-1][1])) if len(places) > 1 else None
    return Ship(x, y, course % 360.0, speed), goal, turns_at_a_waypoint(places)


def write_situation(situation: Situation) -> str:
    """Return a situation as JSON that validates by the schema 0.2.0; ships are numbered, own ship is 1.

    A track becomes waypoints, one a row, with the speed of the way to each.
    """
    plane = Plane(*(situation.origin or (0.0, 0.0)))
    ships = [
        write_ship(ship, number, plane) for number, ship in enumerate((situation.own, *situation.targets), 1)
    ]
    start = {} if situation.start is None else {"startTime": situation.start.strftime("%Y-%m-%dT%H:%M:%SZ")}
    values = {
        "version": SCHEMA_VERSION,
        # The package trafficgen reads these two in place of `version`.
        "schemaVersion": SCHEMA_VERSION,
        "trafficgenVersion": "",
        "title": situation.name,
        "description": "Written by ship_trl.",
        **start,
        "ownShip": ships[0],
        "targetShips": ships[1:],
    }
    return json.dumps(values, indent=2) + "\n"


def write_ship(ship: Ship, number: int, plane: Plane) -> dict[str, Any]:
    """Return a ship for the schema: two waypoints for a ship that keeps course, else those of its track."""
    knots = ship.speed / KNOT
    if ship.track is None:
        # Half an hour on its course, as trafficgen writes it.
        way, angle = max(1.0, ship.speed * 1800.0), math.radians(ship.course)
        rows = [
            (0.0, ship.x, ship.y),
            (1800.0, ship.x + way * math.sin(angle), ship.y + way * math.cos(angle)),
        ]
    else:
        rows = [tuple(row) for row in ship.track.tolist()]
    waypoints: list[dict[str, Any]] = []
    for n, (time, x, y) in enumerate(rows):
        latitude, longitude = plane.to_degrees(x, y)
        point: dict[str, Any] = {"position": {"lon": round(longitude, 8), "lat": round(latitude, 8)}}
        if n:
            before, east, north = rows[n - 1]
            point["leg"] = {"sog": round(math.dist((x, y), (east, north)) / (time - before) / KNOT, 3)}
        waypoints.append(point)
    return {
        "waypoints": waypoints,
        "static": {"id": number, "pathType": "linear"},
        "initial": {
            "position": dict(waypoints[0]["position"]),
            "sog": round(knots, 3),
            "cog": round(ship.course, 3) % 360.0,
            "heading": round(ship.course, 3) % 360.0,
            "navStatus": "Under way using engine",
        },
    }
