"""Speed vectors in the compiled drawing: `Rasteriser._draw_vectors` for one state."""

from __future__ import annotations

import math

import numpy as np
from numba import float32

from ship_trl.jit import NO_NAN, compiled
from ship_trl.sim.fast.step_kernel import ONE, ZERO, Array, Number
from ship_trl.sim.state import (
    HEADING,
    OWN_SIZE,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SIZE,
    SHIP_SPEED,
    SHIP_X,
    SHIP_Y,
    SPEED,
    X,
    Y,
)

HALF, UP = np.float32(0.5), np.float32(math.pi / 2)


@compiled(NO_NAN)
def blend_vectors(image: Array, picture: Array, state: Array, scales: Array, inks: Array, size: int) -> None:
    """Blend the speed vectors of a state [S] over `image` and `picture`; arguments as `draw_kernels.draw`."""
    scale, reach, vector_scale, own_bow, ship_bow = scales
    _, ship_ink, own_ink = inks
    half, turn = float32(size) * HALF, UP - state[HEADING]
    across, ahead = math.cos(turn) * scale, math.sin(turn) * scale
    length = state[SPEED] * vector_scale
    blend_vector(image, picture, own_ink, half, half, UP, own_bow, length, reach, size)
    for k in range((state.shape[0] - OWN_SIZE) // SHIP_SIZE):
        if k >= state[SHIP_COUNT]:
            break
        ship = OWN_SIZE + SHIP_SIZE * k
        east, north = state[ship + SHIP_X] - state[X], state[ship + SHIP_Y] - state[Y]
        cx, cy = east * across - north * ahead + half, half - (east * ahead + north * across)
        heading, length = state[ship + SHIP_HEADING] + turn, state[ship + SHIP_SPEED] * vector_scale
        blend_vector(image, picture, ship_ink, cx, cy, heading, ship_bow, length, reach, size)


@compiled(NO_NAN)
def blend_vector(
    image: Array,
    picture: Array,
    ink: Array,
    cx: Number,
    cy: Number,
    heading: Number,
    bow: Number,
    length: Number,
    reach: Number,
    size: int,
) -> None:
    """Blend one speed vector over `image` (floats) and `picture` (uint8), both [C, P].

    Lengths are in pixels. (cx, cy) is the ship's middle from the left and upper edges, and its vector begins
    `bow` ahead of it; `heading` is counter-clockwise from the right. Coverage is zero `reach` from the line.
    """
    if length <= 0:
        return
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = cx + bow * cos, cy - bow * sin
    end_x, end_y = x + length * cos, y - length * sin
    left, right = max(math.floor(min(x, end_x) - reach), 0), min(math.ceil(max(x, end_x) + reach), size)
    top, bottom = max(math.floor(min(y, end_y) - reach), 0), min(math.ceil(max(y, end_y) + reach), size)
    for row in range(top, bottom):
        for column in range(left, right):
            dx, dy = float32(column) + HALF - cx, cy - float32(row) - HALF
            on_axis, off_axis = dx * cos + dy * sin - bow, dy * cos - dx * sin
            beyond_end = on_axis - min(max(on_axis, ZERO), length)
            distance = math.sqrt(beyond_end * beyond_end + off_axis * off_axis)
            cover, pixel = min(max(reach - distance, ZERO), ONE), row * size + column
            for c in range(image.shape[0]):
                over = image[c, pixel] + cover * (ink[c] - image[c, pixel])
                image[c, pixel] = over
                picture[c, pixel] = np.uint8(over + HALF)
