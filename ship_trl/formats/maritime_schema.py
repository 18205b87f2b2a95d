"""Traffic situations: JSON of the maritime schema 0.2.0, as DNV's `trafficgen` and others write it.

Positions are degrees, courses degrees clockwise from north, speeds knots. Waypoint 1 describes the leg from
waypoint 0 to 1, as in RTZ route plans. The package `maritime-schema` 0.0.7 wrote `latitude` and `longitude`
in place of `lat` and `lon`; both are read.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated, Any

from pydantic import AliasChoices, AliasPath, Field

from ship_trl.config.bounds import KNOT
from ship_trl.config.schema import read_as
from ship_trl.formats.situation import MAX_LATITUDE, PLACE, Plane, Ship, Situation, course_to, notes_on

SCHEMA_VERSION = "0.2.0"


def at(*paths: str) -> Any:
    """Return where a value stands in a file: the first of these paths of keys that is there."""
    parts: list[list[Any]] = [
        [int(one) if one.isdigit() else one for one in path.split(".")] for path in paths
    ]
    return Field(validation_alias=AliasChoices(*(AliasPath(*one) for one in parts)))


Latitude = Annotated[float, Field(ge=-MAX_LATITUDE, le=MAX_LATITUDE)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Degrees = Annotated[float, Field(ge=0, le=360)]
# The fastest speed that an AIS message can hold is 102.2 knots.
Knots = Annotated[float, Field(ge=0, le=102.2)]
PLACES, LEGS = ("initial.position", "waypoints.0.position"), ("waypoints.1.leg", "waypoints.0.leg")
SPEEDS = (f"{leg}.{key}" for leg in LEGS for key in ("data.sog.value", "sog"))


@dataclass
class Waypoint:
    """A place of a route, of either spelling."""

    lat: Annotated[Latitude, at("position.lat", "position.latitude")]
    lon: Annotated[Longitude, at("position.lon", "position.longitude")]


@dataclass
class ShipFile:
    """A ship: what it says of the start counts before its route, and a leg's data before the leg."""

    lat: Annotated[Latitude, at(*(f"{place}.{key}" for place in PLACES for key in ("lat", "latitude")))]
    lon: Annotated[Longitude, at(*(f"{place}.{key}" for place in PLACES for key in ("lon", "longitude")))]
    sog: Annotated[Knots, at("initial.sog", *SPEEDS)]
    cog: Annotated[Degrees | None, at("initial.cog")] = None
    heading: Annotated[Degrees | None, at("initial.heading")] = None
    waypoints: list[Waypoint] = field(default_factory=list)


@dataclass
class SituationFile:
    """A traffic situation; other keys are not read."""

    own: Annotated[ShipFile, at("ownShip")]
    targets: Annotated[list[ShipFile], at("targetShips", "targetShip")] = field(default_factory=list)
    start: Annotated[datetime | None, at("startTime")] = None


def read_situation(values: object, name: str) -> Situation:
    """Read a traffic situation; a null is a key that is not there.

    Raises:
        ValueError, ConfigError: a ship's position, course or speed is missing or wrong; it names the key.
    """
    if not isinstance(values, dict) or "ownShip" not in values:
        raise ValueError("has no ownShip; allowed: a traffic situation")
    file = read_as(SituationFile, without_nulls(values), from_json=True)
    plane = Plane(file.own.lat, file.own.lon)
    own, route = read_ship(file.own, plane, "ownShip")
    found = [read_ship(ship, plane, f"targetShips[{place}]") for place, ship in enumerate(file.targets)]
    goal = route[-1] if len(route) > 1 else None
    if (start := file.start) is not None:
        # One without a time zone is taken as UTC.
        start = start.astimezone(UTC) if start.tzinfo else start.replace(tzinfo=UTC)
    notes = notes_on(places for _, places in found)
    return Situation(name, own, goal, tuple(ship for ship, _ in found), plane, start, notes)


def without_nulls(values: Any) -> Any:
    """Return JSON values without the keys that have no value."""
    if isinstance(values, list):
        return [without_nulls(one) for one in values]
    if isinstance(values, dict):
        return {key: without_nulls(one) for key, one in values.items() if one is not None}
    return values


def read_ship(ship: ShipFile, plane: Plane, where: str) -> tuple[Ship, list[tuple[float, float]]]:
    """Return a ship at the start, and its waypoints (m).

    Its course is `initial.cog`, else the way to its second waypoint, else its heading.
    """
    degrees = [(ship.lat, ship.lon), *((point.lat, point.lon) for point in ship.waypoints)]
    points = (plane.to_metres(*point) for point in degrees)
    (x, y), *places = ((float(east), float(north)) for east, north in points)
    course = ship.cog
    if len(places) > 1:
        if places[0] == places[1]:
            raise ValueError(f"{where}.waypoints[1]: is the same place as waypoints[0]")
        if course is None:
            course = course_to(places[1][0] - places[0][0], places[1][1] - places[0][1])
    if (course := ship.heading if course is None else course) is None:
        raise ValueError(f"{where}: has no course; wanted: initial.cog or two waypoints")
    return Ship(x, y, course % 360.0, KNOT * ship.sog), places


def write_situation(situation: Situation) -> str:
    """Return a situation as JSON that validates by the schema 0.2.0; ships are numbered, own ship is 1.

    A track becomes waypoints, one a row, with the speed of the way to each.
    """
    plane = situation.origin or PLACE
    own, *targets = (
        write_ship(ship, number, plane) for number, ship in enumerate((situation.own, *situation.targets), 1)
    )
    start = {} if situation.start is None else {"startTime": situation.start.strftime("%Y-%m-%dT%H:%M:%SZ")}
    # The package trafficgen reads two of the versions in place of `version`.
    versions = {"version": SCHEMA_VERSION, "schemaVersion": SCHEMA_VERSION, "trafficgenVersion": ""}
    told = {"title": situation.name, "description": "Written by ship_trl.", **start}
    return json.dumps(versions | told | {"ownShip": own, "targetShips": targets}, indent=2) + "\n"


def write_ship(ship: Ship, number: int, plane: Plane) -> dict[str, Any]:
    """Return a ship for the schema: two waypoints for a ship that keeps course, else those of its track."""
    rows = [] if ship.track is None else ship.track.tolist()
    if ship.track is None:
        # Half an hour on its course, as trafficgen writes it.
        way, angle = max(1.0, ship.speed * 1800.0), math.radians(ship.course)
        end = (1800.0, ship.x + way * math.sin(angle), ship.y + way * math.cos(angle))
        rows = [(0.0, ship.x, ship.y), end]
    waypoints: list[dict[str, Any]] = []
    for n, (time, x, y) in enumerate(rows):
        latitude, longitude = plane.to_degrees(x, y)
        point: dict[str, Any] = {"position": {"lon": round(longitude, 8), "lat": round(latitude, 8)}}
        if n:
            before, east, north = rows[n - 1]
            point["leg"] = {"sog": round(math.dist((x, y), (east, north)) / (time - before) / KNOT, 3)}
        waypoints.append(point)
    course = round(ship.course, 3) % 360.0
    initial = {"position": dict(waypoints[0]["position"]), "sog": round(ship.speed / KNOT, 3)}
    initial |= {"cog": course, "heading": course, "navStatus": "Under way using engine"}
    return {"waypoints": waypoints, "static": {"id": number, "pathType": "linear"}, "initial": initial}
