"""The network's picture as a compiled loop for the CPU.

It draws what `render.Rasteriser.reference` draws in torch. Tests compare the two; the torch code is the
reference and runs on the GPU. Only the strip along the line and the squares around target ships are
computed, and without branches: a mispredicted branch costs as much as a dozen pixels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32

from ship_trl.jit import RELAXED, compiled

Array = np.ndarray[Any, Any]
# float32 in compiled code; the types of Python and NumPy differ there.
Number = Any

# `draw` refuses NaN, so that minimum and maximum can be single instructions.
NO_NAN = RELAXED | {"nnan"}
# Bound of |x| + |y| + |heading| + |time|, in metres, radians and seconds. Beyond it squares overflow
# float32, and pixel numbers would lie outside the picture's memory.
MAX_STATE_SUM = np.float32(1e9)
# A Python float would turn every sum into float64.
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
# Metres. A shorter line has no direction, because its squares underflow.
MIN_GOAL_DISTANCE = np.float32(1e-4)
# Width in pixels of the strip that holds the line: at 45 degrees the line covers 2.83 pixels.
STRIP_WIDTH = 3


@compiled(RELAXED)
def copy(source: Array, target: Array) -> None:
    """Copy `source` to `target`; the loop compiles to a block copy, which assigning the array does not."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled(NO_NAN)
def cover_line(
    dx: Number, dy: Number, reach: Number, size: int, cover: Array, pixels: Array
) -> tuple[int, int]:
    """Compute the coverage of the line from the middle to (dx, dy), in pixels; see `Rasteriser._draw_line`.

    The loop walks along the longer axis, and each row of the strip lies across it.

    Args:
        dx: pixels to the right.
        dy: pixels up.
        reach: distance from the line's axis at which coverage becomes zero, in pixels.
        size: width and height of the picture in pixels.
        cover: coverage of the pixels of each row, float32 [STRIP_WIDTH, size / 2]; written.
        pixels: number of each row's first pixel, int32 [size / 2]; written.

    Returns:
        The number of rows, and the step from one pixel of a row to the next.
    """
    if dx == 0 and dy == 0:  # at the goal
        dx = float32(1e-6)
    length = math.sqrt(dx * dx + dy * dy)
    ux, uy = dx / length, dy / length
    steep = abs(dy) > abs(dx)
    major, minor = (uy, ux) if steep else (ux, uy)
    stride, pixel_step = (size, 1) if steep else (1, size)
    slope, half = minor / major, size // 2
    middle, last = float32(half), float32(size - STRIP_WIDTH + 1)
    ahead = ONE if major >= 0 else -ONE
    # Pixels farther along the longer axis are out of reach of the line's end.
    count = min(half, int((length + 3) * abs(major)) + 2)
    for k in range(count):
        along = ahead * (float32(k) + HALF)
        nearest = min(max(math.floor(along * slope + middle), ONE), last)
        column = half + k if major >= 0 else half - 1 - k
        pixels[k] = column * stride + (int(nearest) - 1) * pixel_step
        for j in range(STRIP_WIDTH):
            across = nearest + (float32(j) - HALF - middle)
            past = max(along * major + across * minor - length, ZERO)
            beside = along * minor - across * major
            cover[j, k] = min(max(reach - math.sqrt(beside * beside + past * past), ZERO), ONE)
    return count, pixel_step


@compiled(NO_NAN)
def blend_line(
    image: Array, picture: Array, background: Array, ink: Array, cover: Array, pixels: Array, pixel_step: int
) -> None:
    """Blend `ink` [C] over the background, with the coverage and pixels that `cover_line` wrote.

    Shapes: image float, picture uint8 and background float [C, P]; the first two are written.
    """
    for c in range(image.shape[0]):
        for k in range(pixels.shape[0]):
            for j in range(STRIP_WIDTH):
                pixel = pixels[k] + j * pixel_step
                under = background[c, pixel]
                over = under + cover[j, k] * (ink[c] - under)
                image[c, pixel] = over
                picture[c, pixel] = np.uint8(over + HALF)


@compiled(NO_NAN)
def blend_ship(
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
    """Blend a ship over the picture; see `Rasteriser._draw_ships`.

    Args:
        image: the picture in floats [C, P]; written.
        picture: the picture uint8 [C, P]; written.
        ink: colour of the ship, [C].
        cx: pixels from the picture's left edge to the ship's middle.
        cy: pixels from the picture's upper edge to the ship's middle.
        heading: heading in the picture in radians, counter-clockwise from the right.
        edges: normal and offset of each edge of the outline in pixels, [E, 3].
        size: width and height of the picture in pixels.
        column: column of each pixel of a square of W x W pixels around the ship, [W * W].
        row: row of each of these pixels, [W * W].
        cover: scratch memory for their coverage, [W * W].

    Returns:
        The number of the square's first pixel, or -1 if the ship is outside the picture.
    """
    patch = math.floor(math.sqrt(float32(cover.shape[0])) + HALF)
    if cx < -patch or cy < -patch or cx > size + patch or cy > size + patch:
        return -1
    cos, sin = math.cos(heading), math.sin(heading)
    left = min(max(math.floor(cx - float32(patch) * HALF + HALF), 0), size - patch)
    top = min(max(math.floor(cy - float32(patch) * HALF + HALF), 0), size - patch)
    # The square's first pixel, relative to the ship's middle.
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
            # With slices no index can be negative, so the loop is vectorised.
            share = cover[r * patch : (r + 1) * patch]
            floats, whole = image[c, first : first + patch], picture[c, first : first + patch]
            for i in range(patch):
                over = floats[i] + max(share[i], ZERO) * (ink[c] - floats[i])
                floats[i] = over
                whole[i] = np.uint8(over + HALF)
    return top * size + left


@compiled(RELAXED)
def restore_background(
    image: Array, background: Array, pixels: Array, pixel_step: int, squares: Array, patch: int, size: int
) -> None:
    """Copy `background` to `image`, both [C, P], along the line and in the squares of the target ships.

    `pixels` and `pixel_step` are from `cover_line`. `squares` [K] holds what `blend_ship` returned for each
    target ship, and `patch` is the squares' width in pixels.
    """
    for c in range(image.shape[0]):
        for k in range(pixels.shape[0]):
            for pixel in range(pixels[k], pixels[k] + STRIP_WIDTH * pixel_step, pixel_step):
                image[c, pixel] = background[c, pixel]
        for k in range(squares.shape[0]):
            if squares[k] >= 0:
                for pixel in range(squares[k], squares[k] + patch * size, size):
                    copy(background[c, pixel : pixel + patch], image[c, pixel : pixel + patch])


@compiled(RELAXED)
def draw(
    states: Array,
    goal: Array,
    ships: Array,
    velocity: Array,
    course: Array,
    edges: Array,
    scales: Array,
    patch: int,
    size: int,
    line_ink: Array,
    ship_ink: Array,
    background: Array,
    background_picture: Array,
    pictures: Array,
) -> None:
    """Draw N states into `pictures`; this is `render.Rasteriser` on the CPU.

    Args:
        states: float32 [N, 4].
        goal: position of the goal in metres, [2].
        ships: initial positions of the target ships in metres, [K, 2].
        velocity: velocities of the target ships in m/s, [K, 2].
        course: headings of the target ships in radians, [K].
        edges: normal and offset of each edge of a ship's outline in pixels, [E, 3].
        scales: length of a step (s), pixels per metre, and `reach` of `cover_line` (pixels), [3].
        patch: width in pixels of the square around a ship.
        size: width and height of the picture in pixels.
        line_ink: colour of the line to the goal, [C].
        ship_ink: colour of the target ships, [C].
        background: the picture without line and target ships, float32 [C, P].
        background_picture: the same picture, uint8 [C, P].
        pictures: uint8 [N, C, P]; written.

    Raises:
        ValueError: a state is not finite, or larger than `MAX_STATE_SUM`.
    """
    dt, scale, reach = scales
    channels, half = background.shape[0], float32(size) * HALF
    # Layers are blended in floats; what they changed is restored for the next picture.
    image = background.copy()
    line_cover, pixels = np.empty((STRIP_WIDTH, size // 2), np.float32), np.empty(size // 2, np.int32)
    cover, squares = np.empty(patch * patch, np.float32), np.empty(ships.shape[0], np.int32)
    column, row = np.empty_like(cover), np.empty_like(cover)
    for i in range(patch * patch):
        column[i], row[i] = float32(i % patch), float32(i // patch)
    for n in range(states.shape[0]):
        picture = pictures[n]
        for c in range(channels):
            copy(background_picture[c], picture[c])
        x, y, heading, time = states[n, 0], states[n, 1], states[n, 2], states[n, 3] * dt
        if not abs(x) + abs(y) + abs(heading) + abs(time) < MAX_STATE_SUM:
            raise ValueError("a state to draw is not finite, or beyond 1e9")
        turn = float32(math.pi / 2) - heading
        across, ahead = math.cos(turn) * scale, math.sin(turn) * scale
        east, north = goal[0] - x, goal[1] - y
        if abs(east) + abs(north) < MIN_GOAL_DISTANCE:
            east, north = ZERO, ZERO
        right, up = east * across - north * ahead, -(east * ahead + north * across)
        count, pixel_step = cover_line(right, up, reach, size, line_cover, pixels)
        blend_line(image, picture, background, line_ink, line_cover, pixels[:count], pixel_step)
        for k in range(ships.shape[0]):
            east = ships[k, 0] + time * velocity[k, 0] - x
            north = ships[k, 1] + time * velocity[k, 1] - y
            cx, cy = east * across - north * ahead + half, half - (east * ahead + north * across)
            squares[k] = blend_ship(
                image, picture, ship_ink, cx, cy, course[k] + turn, edges, size, column, row, cover
            )
        restore_background(image, background, pixels[:count], pixel_step, squares, patch, size)
