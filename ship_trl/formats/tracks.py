"""From AIS positions to encounters: split tracks, resample them, and find pairs on collision courses.

Ships that lie near each other are no encounter; two whose predicted closest approach is small and soon are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.types import OwnShip
from ship_trl.formats.ais import Fixes
from ship_trl.formats.situation import Plane, Ship, Situation, course_to, metres_per_degree
from ship_trl.sim.encounter import must_give_way
from ship_trl.sim.geometry import predicted_approach

# Seconds: a longer silence splits a track; MarineCadastre's tables have a fix a minute.
MAX_GAP = 360
# Seconds between the instants at which pairs are looked for, and between the rows of a kept track.
INSTANT = 30
# Metres and m/s. Faster than 60 knots, a fix is at a wrong place.
NEAR, MAX_SPEED, LEAST_SPEED = 6 * NAUTICAL_MILE, 60 * KNOT, 3 * KNOT
EARTH = 6_371_000.0


# Degrees: a ship that turns more manoeuvres.
MANOEUVRE = 10.0


class Limits(NamedTuple):
    """When an encounter begins and ends: metres, seconds; see `ship_trl.sim.encounter.Encounters`.

    Tracks are kept for the time in which own ship goes `way` metres: that of an episode.
    """

    dcpa: float
    tcpa: float
    clear: float
    window: float
    way: float = 6 * NAUTICAL_MILE


class Samples(NamedTuple):
    """Ships at instants, sorted by instant and ship: degrees, and m/s east and north."""

    instant: NDArray[np.int64]
    ship: NDArray[np.int32]
    latitude: NDArray[np.float64]
    longitude: NDArray[np.float64]
    east: NDArray[np.float64]
    north: NDArray[np.float64]


@dataclass
class Found:
    """The situations of a table, and counts of what was looked at."""

    situations: list[Situation]
    pairs: int = 0
    encounters: int = 0
    # Own ships that make less than 3 knots, whose encounters are left out.
    slow: int = 0
    # Target ships, and those that turned more than 10 degrees.
    ships: int = 0
    turned: int = 0


def resample(fixes: Fixes, step: int) -> Samples:
    """Return where ships are at multiples of `step` seconds, between fixes of the same unbroken track.

    Places follow a cubic from speeds and courses where both fixes have them, else a straight line. No place
    is made up across a gap, nor next to a fix that a ship could reach only above 60 knots.
    """
    ship, time, latitude, longitude, speed, course = fixes
    if len(ship) < 2:
        return Samples(*(np.empty(0, kind) for kind in (np.int64, np.int32, float, float, float, float)))
    seconds = np.diff(time).astype(np.float64)
    east_metres, north_metres = metres_per_degree(latitude)
    # A way across the date line counts as a jump, as a plane does not reach across it.
    x, y = np.diff(longitude) * east_metres[:-1], np.diff(latitude) * north_metres[:-1]
    joined = (np.diff(ship) == 0) & (seconds <= MAX_GAP)
    joined &= np.hypot(x, y) <= MAX_SPEED * np.maximum(seconds, 1)
    first = -(-time[:-1] // step)
    # An instant at a fix belongs to the interval that begins there, or to the last interval of a track.
    ends = np.append(~(joined[1:]), True)
    last = np.where(ends, time[1:] // step, -(-time[1:] // step) - 1)
    counts = np.where(joined, np.maximum(last - first + 1, 0), 0)
    k = np.repeat(np.arange(len(counts)), counts)
    offset = np.arange(len(k)) - np.repeat(np.cumsum(counts) - counts, counts)
    instant = (first[k] + offset) * step
    length = seconds[k]
    t = (instant - time[k]) / length
    angle = np.radians(course.astype(np.float64))
    east, north = speed * np.sin(angle), speed * np.cos(angle)
    known = np.isfinite(east)
    smooth = known[k] & known[k + 1]
    # Hermite's cubic: places and speeds at both ends.
    slope_x = (
        np.where(smooth, np.nan_to_num(east[k]) * length, x[k]),
        np.where(smooth, np.nan_to_num(east[k + 1]) * length, x[k]),
    )
    slope_y = (
        np.where(smooth, np.nan_to_num(north[k]) * length, y[k]),
        np.where(smooth, np.nan_to_num(north[k + 1]) * length, y[k]),
    )
    place = [hermite(t, way, *slopes) for way, slopes in ((x[k], slope_x), (y[k], slope_y))]
    rate = [hermite_rate(t, way, *slopes) / length for way, slopes in ((x[k], slope_x), (y[k], slope_y))]
    order = np.lexsort((ship[k], instant))
    latitudes, longitudes = latitude[k] + place[1] / north_metres[k], longitude[k] + place[0] / east_metres[k]
    return Samples(
        instant[order], ship[k][order], latitudes[order], longitudes[order], *(one[order] for one in rate)
    )


def hermite(
    t: NDArray[Any], way: NDArray[Any], slope: NDArray[Any], next_slope: NDArray[Any]
) -> NDArray[Any]:
    """Return the cubic from 0 (t = 0) to `way` (t = 1) with these slopes."""
    cubic: NDArray[Any] = slope * t * (1 - t) ** 2 + way * t**2 * (3 - 2 * t) - next_slope * t**2 * (1 - t)
    return cubic


def hermite_rate(
    t: NDArray[Any], way: NDArray[Any], slope: NDArray[Any], next_slope: NDArray[Any]
) -> NDArray[Any]:
    """Return the derivative of `hermite` by t."""
    rate: NDArray[Any] = slope * (1 - t) * (1 - 3 * t) + way * 6 * t * (1 - t) - next_slope * t * (2 - 3 * t)
    return rate


def find_encounters(fixes: Fixes, limits: Limits, own: OwnShip, most_targets: int) -> Found:
    """Return the situations of a table: for each encounter of two ships one from its first moment on, or two.

    Args:
        fixes: positions of ships.
        limits: when an encounter begins and ends, and how far other ships may be away to belong to it.
        own: which of the two ships is own ship; where the rules say of neither or of both what is asked, both
            are, a situation each.
        most_targets: target ships kept, the other ship first, then others, nearest first.
    """
    samples = resample(fixes, INSTANT)
    found, seen = Found([]), [np.empty(0, np.int64)]
    # Pairs whose encounter is not over, and when they were last near. Whom nobody sees near until after they
    # were to meet can meet again.
    under_way = dict[int, int]()
    paths = Paths(samples)
    bounds = np.flatnonzero(np.diff(samples.instant, prepend=-1, append=-1))
    for begin, end in pairwise(bounds):
        now, (one, two) = int(samples.instant[begin]), near_pairs(samples, int(begin), int(end))
        x, y, east, north = relative(samples, one, two)
        dcpa, tcpa = approach(x, y, east, north)
        moves = np.maximum(speeds(samples, one), speeds(samples, two)) >= LEAST_SPEED
        begins = moves & (dcpa < limits.dcpa) & (tcpa >= 0) & (tcpa <= limits.tcpa)
        is_over = (tcpa < 0) & (np.hypot(x, y) > limits.clear)
        pairs = samples.ship[one].astype(np.int64) << 32 | samples.ship[two]
        seen.append(pairs)
        if len(seen) > 200:
            seen = [np.unique(np.concatenate(seen))]
        under_way = {pair: last for pair, last in under_way.items() if now - last <= limits.tcpa}
        known = np.isin(pairs, [*under_way])
        under_way |= dict.fromkeys(pairs[known].tolist(), now)
        for pair in pairs[known & is_over].tolist():
            del under_way[pair]
        for k in np.flatnonzero(begins):
            if (pair := int(pairs[k])) not in under_way:
                under_way[pair] = now
                found.encounters += 1
                for mine, other in roles(samples, int(one[k]), int(two[k]), own):
                    if speeds(samples, mine) < LEAST_SPEED:
                        found.slow += 1
                        continue
                    ships = nearest(samples, int(begin), int(end), mine, other, limits.window)[:most_targets]
                    name = f"{written(now)}-{len(found.situations) + 1}"
                    found.situations.append(paths.situation(name, mine, ships, limits.way))
    found.pairs = len(np.unique(np.concatenate(seen)))
    for situation in found.situations:
        found.ships += len(situation.targets)
        found.turned += sum(has_turned(ship) for ship in situation.targets)
    return found


def written(instant: int) -> str:
    """Return an instant as 20240304T101530Z."""
    return datetime.fromtimestamp(instant, UTC).strftime("%Y%m%dT%H%M%SZ")


def near_pairs(samples: Samples, begin: int, end: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the rows of pairs of ships within `NEAR` of each other, the lower number first."""
    latitude, longitude = np.radians(samples.latitude[begin:end]), np.radians(samples.longitude[begin:end])
    points = np.stack(
        (np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)), -1
    )
    pairs = cKDTree(points * EARTH).query_pairs(NEAR, output_type="ndarray")
    return begin + pairs[:, 0], begin + pairs[:, 1]


def relative(samples: Samples, one: Any, two: Any) -> tuple[NDArray[Any], ...]:
    """Return where rows `two` are from rows `one` (m east, north) and how they move (m/s east, north)."""
    east, north = metres_per_degree((samples.latitude[one] + samples.latitude[two]) / 2)
    away = (samples.longitude[two] - samples.longitude[one] + 180.0) % 360.0 - 180.0
    return (
        away * east,
        (samples.latitude[two] - samples.latitude[one]) * north,
        samples.east[two] - samples.east[one],
        samples.north[two] - samples.north[one],
    )


def approach(x: Any, y: Any, east: Any, north: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return DCPA (m) and TCPA (s) of arrays; see `ship_trl.sim.geometry.predicted_approach`."""
    away, velocity = (torch.from_numpy(np.stack(one, -1)) for one in ((x, y), (east, north)))
    dcpa, tcpa = predicted_approach(away, velocity)
    return dcpa.numpy(), tcpa.numpy()


def speeds(samples: Samples, row: Any) -> Any:
    """Return the speeds (m/s) of rows."""
    return np.hypot(samples.east[row], samples.north[row])


def roles(samples: Samples, one: int, two: int, own: OwnShip) -> list[tuple[int, int]]:
    """Return rows of own ship and of the other one."""
    both = [(one, two), (two, one)]
    asked = [must_give_way(*bearings(samples, mine, other)) for mine, other in both]
    if own is OwnShip.both or asked[0] == asked[1]:
        return both
    return [both[asked.index(own is OwnShip.gives_way)]]


def bearings(samples: Samples, mine: int, other: int) -> tuple[float, float]:
    """Return the bearing of the other ship from own ship, and of own ship from it: radians, clockwise."""
    x, y, _, _ = relative(samples, mine, other)
    found = (
        math.atan2(sign * x, sign * y) - math.atan2(samples.east[row], samples.north[row])
        for sign, row in ((1, mine), (-1, other))
    )
    bearing, aspect = (math.remainder(angle, 2 * math.pi) for angle in found)
    return bearing, aspect


def nearest(samples: Samples, begin: int, end: int, mine: int, other: int, window: float) -> list[int]:
    """Return the rows of target ships: the other ship, then those within `window` metres, nearest first."""
    rows = np.array([row for row in range(begin, end) if row not in (mine, other)], dtype=np.int64)
    x, y, _, _ = relative(samples, np.full_like(rows, mine), rows)
    distance = np.hypot(x, y)
    order = np.argsort(distance, kind="stable")
    return [other, *rows[order[distance[order] <= window]].tolist()]


class Paths:
    """The rows of each ship in order of time, to follow a ship from an instant on."""

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        self.order = np.lexsort((samples.instant, samples.ship))
        # Where each row stands in that order.
        self.place = np.argsort(self.order)

    def situation(self, name: str, own: int, targets: list[int], way: float) -> Situation:
        """Return the situation of own ship's row and those of its target ships."""
        samples = self.samples
        plane = Plane(float(samples.latitude[own]), float(samples.longitude[own]))
        seconds = way / float(speeds(samples, own))
        ships = [self.ship(plane, row, seconds) for row in (own, *targets)]
        start = datetime.fromtimestamp(int(samples.instant[own]), UTC)
        return Situation(name, ships[0], None, tuple(ships[1:]), plane, start)

    def ship(self, plane: Plane, row: int, seconds: float) -> Ship:
        """Return a ship with its track of the next `seconds`, as far as it is unbroken."""
        samples, place = self.samples, int(self.place[row])
        rows = self.order[place : place + math.ceil(seconds / INSTANT) + 1]
        steps = np.arange(len(rows)) * INSTANT
        unbroken = (samples.ship[rows] == samples.ship[row]) & (
            samples.instant[rows] == samples.instant[row] + steps
        )
        rows = rows[: int(np.argmin(np.append(unbroken, False)))]
        x, y = plane.to_metres(samples.latitude[rows], samples.longitude[rows])
        east, north = float(samples.east[row]), float(samples.north[row])
        track = np.stack((steps[: len(rows)].astype(float), x, y), -1)
        return Ship(float(x[0]), float(y[0]), course_to(east, north), math.hypot(east, north), track)


def has_turned(ship: Ship) -> bool:
    """Return whether a ship's track turns more than 10 degrees from its first course."""
    if ship.track is None or len(ship.track) < 2 or ship.speed < LEAST_SPEED:
        return False
    ways = np.diff(ship.track[:, 1:], axis=0)
    courses = np.degrees(np.arctan2(ways[:, 0], ways[:, 1]))
    off = (courses - ship.course + 180.0) % 360.0 - 180.0
    return bool((np.abs(off[np.hypot(*ways.T) > LEAST_SPEED * INSTANT]) > MANOEUVRE).any())
