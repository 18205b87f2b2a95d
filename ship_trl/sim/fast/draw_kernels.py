"""The network's picture as a compiled loop for the CPU.

It does what `render.Rasteriser.reference` does in torch, which stays the reference and serves the
GPU; tests hold them together. Only the strip along the line and the squares that hold target ships
are computed, without branches: a mispredicted one costs as much as a dozen pixels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32

from ship_trl.jit import RELAXED, compiled

Array = np.ndarray[Any, Any]
# float32 where it is compiled; Python and NumPy disagree on what that is.
Number = Any

# `draw` lets nothing else in; minimum and maximum are single instructions then.
NUMBERS_ONLY = RELAXED | {"nnan"}
# Metres and seconds. Beyond them squares leave float32, and places the picture's memory.
FARTHEST = np.float32(1e9)
# Plain numbers would make every sum a float64.
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
# Metres. Nearer the line has no direction, and squares vanish.
AT_GOAL = np.float32(1e-4)
# Pixels across the strip that holds the line: at 45 degrees it covers 2.83 pixels.
STRIP = 3


@compiled(RELAXED)
def copy(source: Array, target: Array) -> None:
    """Copy in a loop that becomes a block copy, as assigning the array does not."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled(NUMBERS_ONLY)
def strip(dx: Number, dy: Number, reach: Number, size: int, cover: Array, place: Array) -> tuple[int, int]:
    """Draw the line from the middle to (dx, dy), in pixels, right and up; see `Rasteriser._draw_line`.

    Walks along the longer axis. Shapes: cover float32 [STRIP, size / 2], coverage of the pixels
    side by side at each place; place int32 [size / 2], the first pixel of each. Both are written.
    Returns how many places there are, and how far apart pixels lie that are side by side.
    """
    if dx == 0 and dy == 0:  # on the goal itself
        dx = float32(1e-6)
    length = math.sqrt(dx * dx + dy * dy)
    ux, uy = dx / length, dy / length
    steep = abs(dy) > abs(dx)
    major, minor = (uy, ux) if steep else (ux, uy)
    stride, aside = (size, 1) if steep else (1, size)
    slope, half = minor / major, size // 2
    middle, last = float32(half), float32(size - STRIP + 1)
    ahead = ONE if major >= 0 else -ONE
    # No pixel farther along the longer axis is within reach of the line's end.
    count = min(half, int((length + 3) * abs(major)) + 2)
    for k in range(count):
        along = ahead * (float32(k) + HALF)
        nearest = min(max(math.floor(along * slope + middle), ONE), last)
        column = half + k if major >= 0 else half - 1 - k
        place[k] = column * stride + (int(nearest) - 1) * aside
        for j in range(STRIP):
            across = nearest + (float32(j) - HALF - middle)
            past = max(along * major + across * minor - length, ZERO)
            beside = along * minor - across * major
            cover[j, k] = min(max(reach - math.sqrt(beside * beside + past * past), ZERO), ONE)
    return count, aside


@compiled(NUMBERS_ONLY)
def lay_line(
    image: Array, picture: Array, background: Array, ink: Array, cover: Array, place: Array, aside: int
) -> None:
    """Lay ink over the background where `strip` says: image float and picture uint8 [C, P]."""
    for c in range(image.shape[0]):
        for k in range(place.shape[0]):
            for j in range(STRIP):
                pixel = place[k] + j * aside
                under = background[c, pixel]
                over = under + cover[j, k] * (ink[c] - under)
                image[c, pixel] = over
                picture[c, pixel] = np.uint8(over + HALF)


@compiled(NUMBERS_ONLY)
def lay_ship(
    image: Array,
    picture: Array,
    ink: Array,
    cx: Number,
    cy: Number,
    heading: Number,
    edges: Array,
    size: int,
    column: Array,
    row: Array,
    cover: Array,
) -> int:
    """Draw a polygon at (cx, cy), pixels from the upper left corner; see `Rasteriser._draw_ships`.

    Shapes: image float and picture uint8 [C, P]; column, row and cover [W * W], of the pixels of
    the square that holds it: the first two are given, coverage is written.
    Returns the first pixel of that square, or -1 where it is out of the picture.
    """
    patch = math.floor(math.sqrt(float32(cover.shape[0])) + HALF)
    if cx < -patch or cy < -patch or cx > size + patch or cy > size + patch:
        return -1
    cos, sin = math.cos(heading), math.sin(heading)
    left = min(max(math.floor(cx - float32(patch) * HALF + HALF), 0), size - patch)
    top = min(max(math.floor(cy - float32(patch) * HALF + HALF), 0), size - patch)
    # Of the square's first pixel, from the middle of the ship.
    x, y = float32(left) + HALF - cx, cy - float32(top) - HALF
    cover[:] = ONE
    for e in range(edges.shape[0]):
        right = edges[e, 0] * cos - edges[e, 1] * sin
        up = edges[e, 0] * sin + edges[e, 1] * cos
        inside = HALF + edges[e, 2] - up * y - right * x
        for i in range(cover.shape[0]):
            cover[i] = min(cover[i], inside + row[i] * up - column[i] * right)
    for c in range(image.shape[0]):
        for r in range(patch):
            first = (top + r) * size + left
            # Slices, so that no index can be negative and the loop works on many at once.
            share = cover[r * patch : (r + 1) * patch]
            floats, whole = image[c, first : first + patch], picture[c, first : first + patch]
            for i in range(patch):
                over = floats[i] + max(share[i], ZERO) * (ink[c] - floats[i])
                floats[i] = over
                whole[i] = np.uint8(over + HALF)
    return top * size + left


@compiled(RELAXED)
def put_back(
    image: Array, background: Array, place: Array, aside: int, first: Array, patch: int, size: int
) -> None:
    """Make `image` the background again, along the line and in the squares of the target ships."""
    for c in range(image.shape[0]):
        for k in range(place.shape[0]):
            for pixel in range(place[k], place[k] + STRIP * aside, aside):
                image[c, pixel] = background[c, pixel]
        for k in range(first.shape[0]):
            if first[k] >= 0:
                for pixel in range(first[k], first[k] + patch * size, size):
                    copy(background[c, pixel : pixel + patch], image[c, pixel : pixel + patch])


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
    background_picture: Array,
    pictures: Array,
) -> None:
    """Draw N states into `pictures` uint8 [N, C, P] (`render.Rasteriser`).

    Shapes: states [N, 4]; goal [2]; ships, velocity [K, 2]; course [K]; edges [E, 3], normal and
    offset in pixels; numbers [3]: dt, pixels per metre, reach of the line; inks [C]; background
    float and background_picture uint8 [C, P], the same picture.

    Raises:
        ValueError: a state that is no place, or beyond `FARTHEST`.
    """
    dt, scale, reach = numbers
    channels, half = background.shape[0], float32(size) * HALF
    # Layers are laid over each other in floats; what they changed is put back for the next picture.
    image = background.copy()
    along, place = np.empty((STRIP, size // 2), np.float32), np.empty(size // 2, np.int32)
    cover, first = np.empty(patch * patch, np.float32), np.empty(ships.shape[0], np.int32)
    column, row = np.empty_like(cover), np.empty_like(cover)
    for i in range(patch * patch):
        column[i], row[i] = float32(i % patch), float32(i // patch)
    for n in range(states.shape[0]):
        picture = pictures[n]
        for c in range(channels):
            copy(background_picture[c], picture[c])
        x, y, heading, time = states[n, 0], states[n, 1], states[n, 2], states[n, 3] * dt
        if not abs(x) + abs(y) + abs(heading) + abs(time) < FARTHEST:
            raise ValueError("a state to draw is not finite, or beyond 1e9")
        turn = float32(math.pi / 2) - heading
        across, ahead = math.cos(turn) * scale, math.sin(turn) * scale
        east, north = goal[0] - x, goal[1] - y
        if abs(east) + abs(north) < AT_GOAL:
            east, north = ZERO, ZERO
        right, up = east * across - north * ahead, -(east * ahead + north * across)
        count, aside = strip(right, up, reach, size, along, place)
        lay_line(image, picture, background, line_ink, along, place[:count], aside)
        for k in range(ships.shape[0]):
            east = ships[k, 0] + time * velocity[k, 0] - x
            north = ships[k, 1] + time * velocity[k, 1] - y
            cx, cy = east * across - north * ahead + half, half - (east * ahead + north * across)
            first[k] = lay_ship(
                image, picture, ship_ink, cx, cy, course[k] + turn, edges, size, column, row, cover
            )
        put_back(image, background, place[:count], aside, first, patch, size)
