"""Compiled loops for the CPU: one step of the world, and the network's picture.

Each does what the torch code beside it does (`transition`, `render`), which stays the reference
and serves the GPU; tests hold them together. In torch a small batch is all operator overhead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import float32, njit

Array = np.ndarray[Any, Any]

# Rounding may differ in the last bit (fused multiply-add); not-a-numbers stay what they are.
RELAXED = {"contract", "nsz"}
HALF, ONE, ZERO = np.float32(0.5), np.float32(1.0), np.float32(0.0)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, and keep that for later processes where a folder can be written."""
    try:
        return njit(cache=True, fastmath=RELAXED)(function)
    except RuntimeError:  # no place for a cache
        return njit(fastmath=RELAXED)(function)


@compiled
def closest(ax: float, ay: float, bx: float, by: float) -> float:
    """Least distance from the origin of a point that moves from a to b (`geometry.closest_approach`)."""
    tx, ty = bx - ax, by - ay
    length2 = tx * tx + ty * ty
    share = float32(0.0)
    if length2 > 0:
        share = min(max(-(ax * tx + ay * ty) / length2, ZERO), ONE)
    return math.hypot(ax + share * tx, ay + share * ty)


@compiled
def step(
    state: Array,
    action: Array,
    actions: Array,
    goal: Array,
    ships: Array,
    velocity: Array,
    weights: Array,
    limits: Array,
    after: Array,
    reward: Array,
    flags: Array,
    apart: Array,
) -> None:
    """One action of each of N ships (`transition.Transition`), written to the last four arguments.

    Shapes: state, after [N, 4]; action [N]; actions [A, 2]; goal [2]; ships, velocity [K, 2];
    weights [4], of reached, collided, distance and degrees; limits [4]: dt, safe distance, goal
    distance, steps; reward, apart [N]; flags [3, N]: goal, collision, truncated.
    """
    dt, safe, near, most = limits
    for n in range(state.shape[0]):
        x, y, heading, count = state[n]
        speed, turn = actions[action[n]]
        heading = heading + turn * dt
        new_x = x + speed * dt * math.cos(heading)
        new_y = y + speed * dt * math.sin(heading)
        least = float32(np.inf)
        for k in range(ships.shape[0]):
            before, now = count * dt, (count + ONE) * dt
            ax = ships[k, 0] + before * velocity[k, 0] - x
            ay = ships[k, 1] + before * velocity[k, 1] - y
            bx = ships[k, 0] + now * velocity[k, 0] - new_x
            by = ships[k, 1] + now * velocity[k, 1] - new_y
            least = min(least, closest(ax, ay, bx, by))
        east, north = goal[0] - new_x, goal[1] - new_y
        distance = math.hypot(east, north)
        off_bow = math.atan2(north, east) - heading
        off_bow -= float32(2 * math.pi) * math.floor((off_bow + float32(math.pi)) / float32(2 * math.pi))
        collided = least < safe
        reached = distance <= near and not collided
        pay = weights[2] * distance + weights[3] * abs(off_bow) * float32(180.0 / math.pi)
        if reached:
            pay += weights[0]
        if collided:
            pay += weights[1]
        after[n, 0], after[n, 1], after[n, 2], after[n, 3] = new_x, new_y, heading, count + ONE
        reward[n], apart[n] = pay, least
        flags[0, n], flags[1, n] = reached, collided
        flags[2, n] = after[n, 3] >= most and not reached and not collided


@compiled
def blend(image: Array, pixel: int, coverage: float, ink: Array, touched: Array, count: int) -> int:
    """Lay ink over one pixel of `image` [C, P], and remember it; returns how many are remembered."""
    for c in range(image.shape[0]):
        under = image[c, pixel]
        image[c, pixel] = under + coverage * (ink[c] - under)
    touched[count] = pixel
    return count + 1


@compiled
def line(image: Array, dx: float, dy: float, reach: float, ink: Array, size: int, touched: Array) -> int:
    """The line from the middle to (dx, dy), in pixels, right and up; see `Rasteriser._draw_line`."""
    if dx == 0 and dy == 0:
        dx = float32(1e-6)
    length = math.sqrt(dx * dx + dy * dy)
    ux, uy = dx / length, dy / length
    steep = abs(dy) > abs(dx)
    major, minor = (uy, ux) if steep else (ux, uy)
    slope, half, count = minor / major, size // 2, 0
    stride, across_stride = (size, 1) if steep else (1, size)
    # No pixel farther along the longer axis is within reach of the line's end.
    for k in range(min(half, int((length + 3) * abs(major)) + 2)):
        column = half + k if major >= 0 else half - 1 - k
        along = float32(column - half) + HALF
        first = min(max(math.floor(along * slope + float32(half - 1)), 0), size - 4)
        for row in range(first, first + 4):
            across = float32(row - half) + HALF
            past = along * major + across * minor - length
            distance = abs(along * minor - across * major)
            if past > 0:
                distance = math.sqrt(distance * distance + past * past)
            if distance < reach:
                pixel = column * stride + row * across_stride
                count = blend(image, pixel, min(reach - distance, ONE), ink, touched, count)
    return count


@compiled
def ship(
    image: Array,
    cx: float,
    cy: float,
    heading: float,
    edges: Array,
    patch: int,
    ink: Array,
    size: int,
    touched: Array,
    count: int,
) -> int:
    """A polygon at (cx, cy), pixels from the upper left corner; see `Rasteriser._draw_ships`."""
    if cx < -patch or cy < -patch or cx > size + patch or cy > size + patch:
        return count
    cos, sin = math.cos(heading), math.sin(heading)
    # Each edge's distance, outwards, is linear in the picture: right * x - up * (row) - offset.
    sides = np.empty(edges.shape, np.float32)
    for e in range(edges.shape[0]):
        sides[e, 0] = edges[e, 0] * cos - edges[e, 1] * sin
        sides[e, 1] = edges[e, 0] * sin + edges[e, 1] * cos
    left = min(max(math.floor(cx - float32(patch) * HALF + HALF), 0), size - patch)
    top = min(max(math.floor(cy - float32(patch) * HALF + HALF), 0), size - patch)
    for row in range(top, top + patch):
        y = cy - float32(row) - HALF
        # The stretch of the row that no edge cuts off.
        low, high = float32(left) + HALF - cx, float32(left + patch) - HALF - cx
        for e in range(edges.shape[0]):
            room = HALF + edges[e, 2] - sides[e, 1] * y
            if sides[e, 0] > 0:
                high = min(high, room / sides[e, 0])
            elif sides[e, 0] < 0:
                low = max(low, room / sides[e, 0])
            elif room <= 0:
                high = low - ONE
        for column in range(math.ceil(low + cx - HALF), math.floor(high + cx - HALF) + 1):
            x = float32(column) + HALF - cx
            outside = float32(-np.inf)
            for e in range(edges.shape[0]):
                outside = max(outside, sides[e, 0] * x + sides[e, 1] * y - edges[e, 2])
            if outside < HALF:
                pixel = row * size + column
                count = blend(image, pixel, min(HALF - outside, ONE), ink, touched, count)
    return count


@compiled
def copy(source: Array, target: Array) -> None:
    """A loop that becomes a block copy, as assigning the array does not."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def draw(
    states: Array,
    goal: Array,
    ships: Array,
    velocity: Array,
    course: Array,
    edges: Array,
    numbers: Array,
    patch: int,
    size: int,
    line_ink: Array,
    ship_ink: Array,
    background: Array,
    still: Array,
    pictures: Array,
) -> None:
    """Draw N states into `pictures` uint8 [N, C, P] (`render.Rasteriser`).

    Shapes: states [N, 4]; goal [2]; ships, velocity [K, 2]; course [K]; edges [E, 3], normal and
    offset in pixels; numbers [3]: dt, pixels per metre, reach of the line; inks [C]; background
    float and still uint8 [C, P], the same picture.
    """
    dt, scale, reach = numbers
    channels, half = background.shape[0], float32(size) * HALF
    image = background.copy()
    touched = np.empty((size // 2) * 4 + ships.shape[0] * patch * patch, np.int32)
    for n in range(states.shape[0]):
        picture = pictures[n]
        for c in range(channels):
            copy(still[c], picture[c])
        x, y, heading, time = states[n, 0], states[n, 1], states[n, 2], states[n, 3] * dt
        turn = float32(math.pi / 2) - heading
        across, ahead = math.cos(turn) * scale, math.sin(turn) * scale
        east, north = goal[0] - x, goal[1] - y
        right, down = east * across - north * ahead, -(east * ahead + north * across)
        count = line(image, right, down, reach, line_ink, size, touched)
        for k in range(ships.shape[0]):
            east = ships[k, 0] + time * velocity[k, 0] - x
            north = ships[k, 1] + time * velocity[k, 1] - y
            cx, cy = east * across - north * ahead + half, half - (east * ahead + north * across)
            count = ship(image, cx, cy, course[k] + turn, edges, patch, ship_ink, size, touched, count)
        # Only what was touched is rounded to whole numbers, and put back for the next picture.
        for c in range(channels):
            for t in range(count):
                picture[c, touched[t]] = np.uint8(image[c, touched[t]] + HALF)
            for t in range(count):
                image[c, touched[t]] = background[c, touched[t]]
