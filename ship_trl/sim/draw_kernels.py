"""The network's picture as a compiled loop for the CPU.

It does what `render.Rasteriser.reference` does in torch, which stays the reference and serves the
GPU; tests hold them together. Only pixels that something touches are computed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32

from ship_trl.jit import compiled

Array = np.ndarray[Any, Any]
# float32 where it is compiled; Python and NumPy disagree on what that is.
Number = Any

# Rounding may differ in the last bit (fused multiply-add); not-a-numbers stay what they are.
RELAXED = {"contract", "nsz"}
# Plain numbers would make every sum a float64.
HALF, ONE = np.float32(0.5), np.float32(1.0)


@compiled(RELAXED)
def blend(image: Array, pixel: int, coverage: Number, ink: Array, touched: Array, count: int) -> int:
    """Lay ink over one pixel of `image` [C, P], and remember it; returns how many are remembered."""
    for c in range(image.shape[0]):
        under = image[c, pixel]
        image[c, pixel] = under + coverage * (ink[c] - under)
    touched[count] = pixel
    return count + 1


@compiled(RELAXED)
def line(image: Array, dx: Number, dy: Number, reach: Number, ink: Array, size: int, touched: Array) -> int:
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


@compiled(RELAXED)
def stretch(sides: Array, y: Number, low: Number, high: Number) -> tuple[Number, Number]:
    """What no side cuts off of a row at `y`, of the stretch from `low` to `high`.

    Shapes: sides [E, 3], so that `sides[0] * x + sides[1] * y - sides[2]` is the distance outwards.
    """
    for e in range(sides.shape[0]):
        room = HALF + sides[e, 2] - sides[e, 1] * y
        if sides[e, 0] > 0:
            high = min(high, room / sides[e, 0])
        elif sides[e, 0] < 0:
            low = max(low, room / sides[e, 0])
        elif room <= 0:
            high = low - ONE
    return low, high


@compiled(RELAXED)
def ship(
    image: Array,
    cx: Number,
    cy: Number,
    heading: Number,
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
    sides = np.empty(edges.shape, np.float32)
    for e in range(edges.shape[0]):
        sides[e, 0] = edges[e, 0] * cos - edges[e, 1] * sin
        sides[e, 1] = edges[e, 0] * sin + edges[e, 1] * cos
        sides[e, 2] = edges[e, 2]
    left = min(max(math.floor(cx - float32(patch) * HALF + HALF), 0), size - patch)
    top = min(max(math.floor(cy - float32(patch) * HALF + HALF), 0), size - patch)
    for row in range(top, top + patch):
        y = cy - float32(row) - HALF
        low, high = stretch(sides, y, float32(left) + HALF - cx, float32(left + patch) - HALF - cx)
        # A side along the row may have cut it off at infinity, which is no whole number.
        if high < low:
            continue
        for column in range(math.ceil(low + cx - HALF), math.floor(high + cx - HALF) + 1):
            x = float32(column) + HALF - cx
            outside = float32(-np.inf)
            for e in range(sides.shape[0]):
                outside = max(outside, sides[e, 0] * x + sides[e, 1] * y - sides[e, 2])
            if outside < HALF:
                pixel = row * size + column
                count = blend(image, pixel, min(HALF - outside, ONE), ink, touched, count)
    return count


@compiled(RELAXED)
def copy(source: Array, target: Array) -> None:
    """A loop that becomes a block copy, as assigning the array does not."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled(RELAXED)
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
