"""Draw random encounters in a compiled loop; `ship_trl.sim.traffic` says what is drawn."""

from __future__ import annotations

import math

import numpy as np
from numba import uint64
from numba.extending import register_jitable

from ship_trl.jit import RELAXED, compiled
from ship_trl.sim import encounter
from ship_trl.sim.fast.step_kernel import Array, bearing_of
from ship_trl.sim.state import (
    GIVES_WAY,
    HOLDS_COURSE,
    OWN_SIZE,
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SIZE,
    SHIP_SPEED,
    SHIP_X,
    SHIP_Y,
)

# A ship that fails is drawn again, and so is a scene, at most this often.
MAX_SHIPS, MAX_SCENES = 1000, 1000
# A ship must have had its class of encounter for this long (s) when the episode begins.
CLASS_SECONDS = 3.0
NORTH = math.pi / 2

classify = register_jitable(encounter.classify)


@compiled(RELAXED)
def uniform(stream: Array) -> float:
    """Return the next number from 0 to 1 of a stream, uint64 [1]: SplitMix64 (Steele et al. 2014)."""
    stream[0] += uint64(0x9E3779B97F4A7C15)
    bits = stream[0]
    bits = (bits ^ (bits >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> uint64(27))) * uint64(0x94D049BB133111EB)
    return float((bits ^ (bits >> uint64(31))) >> uint64(11)) / 2.0**53


@compiled(RELAXED)
def draw_ship(stream: Array, band: Array, kind: int, bounds: Array, ship: Array) -> bool:
    """Draw a target ship of a class into `ship` [SHIP_SIZE]; return whether it keeps the bounds.

    Args:
        stream: of random numbers, changed.
        band: least and greatest course (rad), the two signs of it, least and greatest speed (m/s).
        kind: the class of encounter.
        bounds: own ship's speed (m/s), then ends of the times to the meeting point (s), largest DCPA (m),
            ends of the distances (m), share of ships that react.
        ship: written.
    """
    own_speed, first, last, offset, nearest, farthest, reacting = bounds
    side = band[2] if uniform(stream) < 0.5 else band[3]
    heading = NORTH + side * (band[0] + (band[1] - band[0]) * uniform(stream))
    speed = band[4] + (band[5] - band[4]) * uniform(stream)
    seconds = first + (last - first) * uniform(stream)
    east, north = speed * math.cos(heading), speed * math.sin(heading) - own_speed
    # Own and target ship are `aside` from each other, across their relative way, after these seconds.
    aside = offset * (2 * uniform(stream) - 1) / max(math.sqrt(east * east + north * north), 1e-6)
    x, y = -east * seconds - north * aside, -north * seconds + east * aside
    ship[SHIP_X], ship[SHIP_Y], ship[SHIP_HEADING], ship[SHIP_SPEED] = x, y, heading, speed
    ship[SHIP_BEHAVIOUR] = GIVES_WAY if uniform(stream) < reacting else HOLDS_COURSE
    if not nearest * nearest <= x * x + y * y <= farthest * farthest:
        return False
    for ago in (0.0, CLASS_SECONDS):
        away_x, away_y = x - east * ago, y - north * ago
        bearing, aspect = bearing_of(away_x, away_y, NORTH), bearing_of(-away_x, -away_y, heading)
        if classify(bearing, aspect) != kind:
            return False
    return True


@compiled(RELAXED)
def keeps_clear(path: Array, ships: Array, dt: float, safe_distance: float) -> bool:
    """Return whether own ship keeps clear of ships [K, SHIP_SIZE] that hold course, on a path [T, 2] (m)."""
    safe2 = safe_distance * safe_distance
    for k in range(ships.shape[0]):
        ship = ships[k]
        way_x = ship[SHIP_SPEED] * dt * math.cos(ship[SHIP_HEADING])
        way_y = ship[SHIP_SPEED] * dt * math.sin(ship[SHIP_HEADING])
        x, y = ship[SHIP_X], ship[SHIP_Y]
        for t in range(path.shape[0]):
            after_x, after_y = ship[SHIP_X] + (t + 1) * way_x, ship[SHIP_Y] + (t + 1) * way_y
            after_x, after_y = after_x - path[t, 0], after_y - path[t, 1]
            moved_x, moved_y = after_x - x, after_y - y
            moved2 = moved_x * moved_x + moved_y * moved_y
            share = -(x * moved_x + y * moved_y)
            # Nearest within the step, as `step_kernel.closest_approach`, without a root.
            share = min(max(share / moved2, 0.0), 1.0) if moved2 > 0 else 0.0
            near_x, near_y = x + share * moved_x, y + share * moved_y
            if near_x * near_x + near_y * near_y < safe2:
                return False
            x, y = after_x, after_y
    return True


@compiled(RELAXED)
def draw_ships(stream: Array, drawn: Array, bands: Array, kinds: Array, bounds: Array, ships: Array) -> bool:
    """Draw ships [K, SHIP_SIZE] of the classes `drawn` [K], indices of `kinds`; return whether all are found.

    The other arguments are those of `draw_scenes`.
    """
    for k in range(drawn.shape[0]):
        is_found = False
        for _ in range(MAX_SHIPS):
            is_found = draw_ship(stream, bands[drawn[k]], kinds[drawn[k]], bounds, ships[k])
            if is_found:
                break
        if not is_found:
            return False
    return True


@compiled(RELAXED)
def is_solvable(paths: Array, lengths: Array, ships: Array, dt: float, safe_distance: float) -> bool:
    """Return whether a manoeuvre keeps clear of ships [K, SHIP_SIZE]; arguments as in `draw_scenes`."""
    for p in range(paths.shape[0]):  # noqa: SIM110 (numba compiles no generator)
        if keeps_clear(paths[p, : lengths[p]], ships, dt, safe_distance):
            return True
    return False


@compiled(RELAXED)
def draw_scenes(
    seeds: Array,
    shares: Array,
    kinds: Array,
    bands: Array,
    bounds: Array,
    paths: Array,
    lengths: Array,
    limits: Array,
    states: Array,
) -> bool:
    """Draw N scenes, each from its own seed; return whether all have been found.

    Args:
        seeds: uint64 [N].
        shares: of scenes with at most 0, 1, 2, ... target ships [K + 1].
        kinds: classes of encounter, equally likely, int64 [C].
        bands: what ships of each class are drawn from [C, 6], see `draw_ship`.
        bounds: see `draw_ship`.
        paths: own ship's positions (m) after each step of the manoeuvres of which one must succeed
            [P, T, 2].
        lengths: steps of each manoeuvre, int64 [P].
        limits: dt (s) and the safe distance (m).
        states: float32 [N, S] without ships; the ships are written.
    """
    dt, safe_distance = limits
    places, stream = shares.shape[0] - 1, np.empty(1, np.uint64)
    ships, drawn = np.empty((places, SHIP_SIZE)), np.empty(places, np.int64)
    for n in range(seeds.shape[0]):
        stream[0] = seeds[n]
        share, count = uniform(stream), 0
        while count < places and share >= shares[count]:
            count += 1
        for k in range(count):
            drawn[k] = int(uniform(stream) * kinds.shape[0])
        for _ in range(MAX_SCENES):
            is_found = draw_ships(stream, drawn[:count], bands, kinds, bounds, ships)
            if not is_found:
                return False
            is_found = is_solvable(paths, lengths, ships[:count], dt, safe_distance)
            if is_found:
                break
        if not is_found:
            return False
        states[n, SHIP_COUNT] = count
        for k in range(count):
            for i in range(SHIP_SIZE):
                states[n, OWN_SIZE + SHIP_SIZE * k + i] = ships[k, i]
    return True
