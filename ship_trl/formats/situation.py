"""A situation: an encounter of another tool, in the units of the sea.

Metres on a plane that touches the earth at own ship's start, x east and y north; courses in degrees clockwise
from north; m/s; seconds. `ship_trl.foreign.suites` makes cases of the simulator's size of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# Degrees: a smaller change of course from leg to leg is rounding.
LEAST_TURN = 1.0
# Nearer to a pole, metres of longitude are too short for a plane.
MAX_LATITUDE = 85.0
# WGS84: half the equator's diameter in metres, and the square of the eccentricity.
EQUATOR, ECCENTRICITY = 6_378_137.0, 6.694379990141e-3


def metres_per_degree(latitude: Any) -> tuple[Any, Any]:
    """Return the length (m) of a degree of longitude and of latitude at latitudes (degrees), by WGS84."""
    angle = np.radians(latitude)
    flattened = 1 - ECCENTRICITY * np.sin(angle) ** 2
    parallel, meridian = np.cos(angle) / np.sqrt(flattened), (1 - ECCENTRICITY) / flattened**1.5
    return np.radians(EQUATOR * parallel), np.radians(EQUATOR * meridian)


class Plane(NamedTuple):
    """The plane that touches the earth at a latitude and longitude (degrees).

    Distances from the touching point are 3 m wrong at 5 km, and 13 m at 10 km and 55 degrees of latitude.
    """

    latitude: float
    longitude: float

    def to_metres(self, latitude: Any, longitude: Any) -> tuple[Any, Any]:
        """Return x and y (m), also of arrays; the plane may lie across the date line."""
        east, north = metres_per_degree(self.latitude)
        away = (longitude - self.longitude + 180.0) % 360.0 - 180.0
        return east * away, north * (latitude - self.latitude)

    def to_degrees(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return latitude and longitude (degrees) of x and y (m), also of arrays."""
        east, north = metres_per_degree(self.latitude)
        return self.latitude + y / north, (self.longitude + x / east + 180.0) % 360.0 - 180.0


# Of what is written, where a scene has no place and time.
PLACE, START = Plane(0.0, 0.0), datetime(2025, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Ship:
    """A ship at the start: metres, degrees clockwise from north, m/s.

    `track` [T, 3] is where it was, rows of seconds after the start, x and y; None if nobody knows.
    """

    x: float
    y: float
    course: float
    speed: float
    track: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Situation:
    """An encounter of another tool.

    `goal` (m) is own ship's last waypoint, None if the file has none. `notes` are what a reader should know,
    such as a target ship that turns at a waypoint. `origin` is where the plane touches the earth, `start`
    the time (UTC), each None if the file has none.
    """

    name: str
    own: Ship
    goal: tuple[float, float] | None
    targets: tuple[Ship, ...]
    origin: Plane | None = None
    start: datetime | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise a ValueError if nothing can be made of it."""
        if self.own.speed <= 0:
            raise ValueError("own ship is at rest; allowed: a speed above 0")
        if self.goal is not None and math.hypot(*self.goal) == 0:
            raise ValueError("own ship's last waypoint is its start")


def course_to(x: float, y: float) -> float:
    """Return the course (degrees) of a way of x metres east and y metres north."""
    return math.degrees(math.atan2(x, y)) % 360.0


def notes_on(routes: Iterable[Sequence[tuple[float, float]]]) -> tuple[str, ...]:
    """Return a note if a target ship turns: if the legs between its waypoints (m) have different courses."""
    for route in routes:
        ways = ((x - west, y - south) for (west, south), (x, y) in pairwise(route) if (x, y) != (west, south))
        courses = [course_to(*way) for way in ways]
        if any(abs((course - courses[0] + 180.0) % 360.0 - 180.0) > LEAST_TURN for course in courses):
            return ("a target ship turns at a waypoint; it keeps its first course",)
    return ()
