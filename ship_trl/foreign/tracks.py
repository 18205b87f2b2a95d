"""From AIS positions to encounters: split tracks, resample them, and find pairs on collision courses.

Ships that lie near each other are no encounter; two whose predicted closest approach is small and soon are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
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
# Seconds between the instants at which pairs are looked for, and between the rows of a kept track; seconds
# of traffic that are resampled at once.
INSTANT, PIECE = 30, 3600
# Metres and m/s. Faster than 60 knots, a fix is at a wrong place.
NEAR, MAX_SPEED, LEAST_SPEED = 6 * NAUTICAL_MILE, 60 * KNOT, 3 * KNOT
EARTH = 6_371_000.0
# Degrees: a ship that turns more manoeuvres.
MANOEUVRE = 10.0
# Degrees, and fixes of which courses are compared with the ways to the next fixes.
OFF_COURSE, MAX_COMPARED = 45.0, 1_000_000


class Limits(NamedTuple):
    """When an encounter begins and ends: metres, seconds; see `ship_trl.sim.encounter.Limits`.

    In tracks it ends as soon as ships move apart and are `clear` m away. Tracks are kept for the time in
    which own ship goes `way` metres: that of an episode. An encounter that is first seen with a TCPA below
    `soonest` is left out: a track begins or a ship turns so late that nobody could act in time.
    """

    dcpa: float
    tcpa: float
    clear: float
    window: float
    way: float = 6 * NAUTICAL_MILE
    soonest: float = 0.0


class Samples(NamedTuple):
    """Ships at instants, sorted by instant and ship.

    `place` [N, 2] is longitude and latitude (degrees), `motion` [N, 2] m/s east and north.
    """

    instant: NDArray[np.int64]
    ship: NDArray[np.int32]
    place: NDArray[np.float64]
    motion: NDArray[np.float64]


@dataclass
class Found:
    """The situations of a table, and counts of what was looked at."""

    situations: list[Situation]
    pairs: int = 0
    encounters: int = 0
    # Own ships that make less than 3 knots, and encounters that are seen too late: both are left out.
    slow: int = 0
    late: int = 0
    # Target ships, and those that turned more than 10 degrees.
    ships: int = 0
    turned: int = 0


def resample(fixes: Fixes, step: int) -> Samples:
    """Return where ships are at multiples of `step` seconds, between fixes of the same unbroken track.

    Places follow a cubic from speeds and courses where both fixes have them, else a straight line. No place
    is made up across a gap, nor next to a fix that a ship could reach only above 60 knots.
    """
    ship, time, latitude, longitude, speed, course = fixes
    seconds, degrees = np.diff(time).astype(np.float64), np.stack((longitude, latitude), -1)
    metres = np.stack(metres_per_degree(latitude), -1)
    # A way across the date line counts as a jump, as a plane does not reach across it.
    ways = np.diff(degrees, axis=0) * metres[:-1]
    joined = (np.diff(ship) == 0) & (seconds <= MAX_GAP)
    joined &= np.hypot(*ways.T) <= MAX_SPEED * np.maximum(seconds, 1)
    first = -(-time[:-1] // step)
    # An instant at a fix belongs to the interval that begins there, or to the last interval of a track.
    ends = np.append(~joined[1:], True)[: len(joined)]
    last = np.where(ends, time[1:] // step, -(-time[1:] // step) - 1)
    counts = np.where(joined, np.maximum(last - first + 1, 0), 0)
    k = np.repeat(np.arange(len(counts)), counts)
    offset = np.arange(len(k)) - np.repeat(np.cumsum(counts) - counts, counts)
    instant = (first[k] + offset) * step
    length, way = seconds[k, None], ways[k]
    t = (instant - time[k])[:, None] / length
    angle = np.radians(course.astype(np.float64))
    motion = speed[:, None] * np.stack((np.sin(angle), np.cos(angle)), -1)
    smooth = np.isfinite(motion[k] + motion[k + 1])
    # Hermite's cubic, with these slopes at both ends of the way.
    slope, next_slope = (np.where(smooth, motion[row] * length, way) for row in (k, k + 1))
    cubic = slope * t * (1 - t) ** 2 + way * t**2 * (3 - 2 * t) - next_slope * t**2 * (1 - t)
    rate = slope * (1 - t) * (1 - 3 * t) + way * 6 * t * (1 - t) - next_slope * t * (2 - 3 * t)
    order, place = np.lexsort((ship[k], instant)), degrees[k] + cubic / metres[k]
    return Samples(instant[order], ship[k][order], place[order], (rate / length)[order])


def follow_courses(fixes: Fixes) -> bool:
    """Return whether most ways from fix to fix lie within 45 degrees of the course that the first one tells.

    Where latitudes and longitudes are exchanged they do not, as ways are mirrored. Slow ships do not count.
    """
    ship, time, latitude, longitude, speed, course = (column[:MAX_COMPARED] for column in fixes)
    east, north = metres_per_degree(latitude[:-1])
    x, y, seconds = east * np.diff(longitude), north * np.diff(latitude), np.diff(time)
    compared = (np.diff(ship) == 0) & (seconds <= MAX_GAP) & np.isfinite(course[:-1])
    compared &= (speed[:-1] >= LEAST_SPEED) & (np.hypot(x, y) >= LEAST_SPEED * seconds)
    off = np.abs((np.degrees(np.arctan2(x, y)) - course[:-1] + 180.0) % 360.0 - 180.0)[compared]
    return bool(np.mean(off > OFF_COURSE) <= 0.5) if off.size else True


def find_encounters(fixes: Fixes, limits: Limits, own: OwnShip, most_targets: int) -> Found:
    """Return the situations of a table: for each encounter of two ships one from its first moment on, or two.

    Args:
        fixes: positions of ships.
        limits: when an encounter begins and ends, and how far other ships may be away to belong to it.
        own: which of the two ships is own ship; where the rules say of neither or of both what is asked, both
            are, a situation each.
        most_targets: target ships kept, the other ship first, then others, nearest first.
    """
    found, seen = Found([]), [np.empty(0, np.int64)]
    # Pairs whose encounter is not over, and when they were last near. Whom nobody sees near until after they
    # were to meet can meet again.
    under_way = dict[int, int]()
    for samples, begin, end in instants(fixes):
        now, (one, two) = int(samples.instant[begin]), near_pairs(samples, begin, end)
        away, motion = relative(samples, one, two)
        dcpa, tcpa = (
            one.numpy() for one in predicted_approach(torch.from_numpy(away), torch.from_numpy(motion))
        )
        moves = np.maximum(speeds(samples, one), speeds(samples, two)) >= LEAST_SPEED
        begins = moves & (dcpa < limits.dcpa) & (tcpa >= 0) & (tcpa <= limits.tcpa)
        is_over = (tcpa < 0) & (np.hypot(*away.T) > limits.clear)
        pairs = samples.ship[one].astype(np.int64) << 32 | samples.ship[two]
        seen.append(pairs)
        if len(seen) > 200:
            seen = [np.unique(np.concatenate(seen))]
        under_way = {pair: last for pair, last in under_way.items() if now - last <= limits.tcpa}
        known = np.isin(pairs, [*under_way])
        under_way |= dict.fromkeys(pairs[known].tolist(), now)
        for pair in pairs[known & is_over].tolist():
            del under_way[pair]
        for k in sorted(np.flatnonzero(begins), key=pairs.__getitem__):
            if (pair := int(pairs[k])) not in under_way:
                under_way[pair] = now
                found.encounters += 1
                if tcpa[k] < limits.soonest:
                    found.late += 1
                    continue
                for mine, other in roles(samples, int(one[k]), int(two[k]), own):
                    if speeds(samples, mine) < LEAST_SPEED:
                        found.slow += 1
                        continue
                    rows = [mine, *nearest(samples, begin, end, mine, other, limits.window)[:most_targets]]
                    name = f"{datetime.fromtimestamp(now, UTC):%Y%m%dT%H%M%SZ}-{len(found.situations) + 1}"
                    found.situations.append(situation_of(name, samples, rows, fixes, limits.way))
    found.pairs = len(np.unique(np.concatenate(seen)))
    for situation in found.situations:
        found.ships += len(situation.targets)
        found.turned += sum(has_turned(ship) for ship in situation.targets)
    return found


def instants(fixes: Fixes) -> Iterator[tuple[Samples, int, int]]:
    """Yield the ships at each instant: samples, and the first of their rows and that after the last.

    Traffic is resampled an hour at a time, for a table may have many million rows.
    """
    by_time = np.argsort(fixes.time, kind="stable").astype(np.uint32)
    time = fixes.time[by_time]
    # No track is joined across an hour without a fix.
    for hour in np.unique(time // PIECE) * PIECE:
        first, last = np.searchsorted(time, (hour - MAX_GAP, hour + PIECE + MAX_GAP))
        rows = np.sort(by_time[first:last])
        samples = resample(fixes.at(rows), INSTANT)
        for begin, end in pairwise(np.flatnonzero(np.diff(samples.instant, prepend=-1, append=-1)).tolist()):
            if hour <= samples.instant[begin] < hour + PIECE:
                yield samples, begin, end


def near_pairs(samples: Samples, begin: int, end: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the rows of pairs of ships within `NEAR` of each other, the lower number first."""
    longitude, latitude = np.radians(samples.place[begin:end]).T
    points = np.stack(
        (np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)), -1
    )
    pairs = cKDTree(points * EARTH).query_pairs(NEAR, output_type="ndarray")
    return begin + pairs[:, 0], begin + pairs[:, 1]


def relative(samples: Samples, one: Any, two: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return where rows `two` are from rows `one` (m), and how they move (m/s): [..., 2], east and north."""
    first, second = samples.place[one], samples.place[two]
    away = second - first
    away[..., 0] = (away[..., 0] + 180.0) % 360.0 - 180.0
    metres = np.stack(metres_per_degree((first[..., 1] + second[..., 1]) / 2), -1)
    return away * metres, samples.motion[two] - samples.motion[one]


def speeds(samples: Samples, row: Any) -> Any:
    """Return the speeds (m/s) of rows."""
    return np.hypot(samples.motion[row, 0], samples.motion[row, 1])


def roles(samples: Samples, one: int, two: int, own: OwnShip) -> list[tuple[int, int]]:
    """Return rows of own ship and of the other one."""
    both = [(one, two), (two, one)]
    asked = [must_give_way(*bearings(samples, mine, other)) for mine, other in both]
    if own is OwnShip.both or asked[0] == asked[1]:
        return both
    return [both[asked.index(own is OwnShip.gives_way)]]


def bearings(samples: Samples, mine: int, other: int) -> tuple[float, float]:
    """Return the bearing of the other ship from own ship, and of own ship from it: radians, clockwise."""
    (x, y), _ = relative(samples, mine, other)
    found = (
        math.atan2(sign * x, sign * y) - math.atan2(*samples.motion[row])
        for sign, row in ((1, mine), (-1, other))
    )
    bearing, aspect = (math.remainder(angle, 2 * math.pi) for angle in found)
    return bearing, aspect


def nearest(samples: Samples, begin: int, end: int, mine: int, other: int, window: float) -> list[int]:
    """Return the rows of target ships: the other ship, then those within `window` metres, nearest first."""
    rows = np.delete(np.arange(begin, end), (mine - begin, other - begin))
    away, _ = relative(samples, mine, rows)
    distance = np.hypot(*away.T)
    order = np.argsort(distance, kind="stable")
    return [other, *rows[order[distance[order] <= window]].tolist()]


def situation_of(name: str, samples: Samples, rows: list[int], fixes: Fixes, way: float) -> Situation:
    """Return the situation of own ship's row and those of its target ships; their tracks are from `fixes`."""
    own = rows[0]
    longitude, latitude = samples.place[own].tolist()
    plane = Plane(latitude, longitude)
    seconds = math.ceil(way / float(speeds(samples, own)) / INSTANT) * INSTANT
    ships = [ship_of(samples, row, plane, fixes, seconds) for row in rows]
    start = datetime.fromtimestamp(int(samples.instant[own]), UTC)
    return Situation(name, ships[0], None, tuple(ships[1:]), plane, start)


def ship_of(samples: Samples, row: int, plane: Plane, fixes: Fixes, seconds: int) -> Ship:
    """Return a row's ship with its track of the next `seconds`, as far as it is unbroken."""
    begin = int(samples.instant[row])
    first, last = np.searchsorted(fixes.ship, samples.ship[row] + np.arange(2, dtype=np.int32))
    # One fix before, and two after: between them lie the first and the last instant.
    after = first + np.searchsorted(fixes.time[first:last], (begin, begin + seconds))
    few = slice(max(int(after[0]) - 1, first), min(int(after[1]) + 2, last))
    track = resample(fixes.at(few), INSTANT)
    steps = track.instant - begin
    unbroken = steps == np.arange(len(steps)) * INSTANT + steps[0]
    kept = (steps >= 0) & (steps <= seconds) & unbroken
    x, y = plane.to_metres(*track.place[kept].T[::-1])
    east, north = samples.motion[row].tolist()
    rows = np.stack((steps[kept].astype(float), x, y), -1)
    return Ship(float(x[0]), float(y[0]), course_to(east, north), math.hypot(east, north), rows)


def has_turned(ship: Ship) -> bool:
    """Return whether a ship's track turns more than 10 degrees from its first course."""
    if ship.track is None or len(ship.track) < 2 or ship.speed < LEAST_SPEED:
        return False
    ways = np.diff(ship.track[:, 1:], axis=0)
    courses = np.degrees(np.arctan2(ways[:, 0], ways[:, 1]))
    off = (courses - ship.course + 180.0) % 360.0 - 180.0
    return bool((np.abs(off[np.hypot(*ways.T) > LEAST_SPEED * INSTANT]) > MANOEUVRE).any())
