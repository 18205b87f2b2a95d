"""`render.Rasteriser.reference` as a compiled loop for the CPU; tests compare the two.

Only the strip along the line and the squares around target ships are computed. Their loops have no branches:
a mispredicted branch costs as much as a dozen pixels.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numba import float32
from torch import Tensor

from ship_trl.fast.jit import NO_NAN, RELAXED, compiled
from ship_trl.fast.step import ONE, ZERO, Array, Number
from ship_trl.sim import scene
from ship_trl.sim.geometry import polygon_edges
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.state import (
    GOAL_X,
    GOAL_Y,
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

# Bound of the sum of a state's absolute numbers. Above it, squares overflow float32, and pixel indices would
# point outside the picture's memory.
MAX_STATE_SUM = np.float32(1e9)
HALF, UP = np.float32(0.5), np.float32(math.pi / 2)
# Metres. A shorter line has no direction, because its squares underflow.
MIN_GOAL_DISTANCE = np.float32(1e-4)
# Width in pixels of the strip that holds the line: at 45 degrees the line covers 2.83 pixels.
STRIP_WIDTH = 3


@compiled(RELAXED)
def copy(source: Array, target: Array) -> None:
    """Copy `source` to `target`; unlike an array assignment, this loop compiles to a block copy."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled(NO_NAN)
def cover_line(
    dx: Number, dy: Number, reach: Number, size: int, cover: Array, pixels: Array
) -> tuple[int, int]:
    """Compute the coverage of pixels by the line from the middle to (dx, dy): right and up, in pixels.

    This is `Rasteriser._draw_line` for one state. A strip holds the line. The loop walks along the line's
    longer axis; each row of the strip crosses that axis. Coverage is zero `reach` pixels from the line.

    Write the coverage of each row's pixels into `cover`, float32 [STRIP_WIDTH, size / 2], and the flat index
    of each row's first pixel into `pixels`, int32 [size / 2]. Return the number of rows, and the difference
    of the flat indices of two neighbours in a row.
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
            beyond_end = max(along * major + across * minor - length, ZERO)
            off_axis = along * minor - across * major
            distance = math.sqrt(off_axis * off_axis + beyond_end * beyond_end)
            cover[j, k] = min(max(reach - distance, ZERO), ONE)
    return count, pixel_step


@compiled(NO_NAN)
def blend_line(
    image: Array, picture: Array, background: Array, ink: Array, cover: Array, pixels: Array, pixel_step: int
) -> None:
    """Blend `ink` [C] over the background [C, P], with the coverage and pixels of `cover_line`.

    Write the result into `image` in floats and `picture` in uint8, both [C, P].
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
    """Blend a ship of colour `ink` [C] over `image` (floats) and `picture` (uint8), both [C, P].

    This is `Rasteriser._draw_ships` for one ship. (cx, cy) is its middle in pixels from the left and upper
    edges, `heading` is counter-clockwise from the right, and `edges` [E, 3] is from `polygon_edges`. Only a
    square of W x W pixels is drawn: `column` and `row` [W * W] of its pixels, `cover` scratch memory.

    Return the flat index of the square's first pixel, or -1 if the ship is outside the picture.
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
            cover_row = cover[r * patch : (r + 1) * patch]
            image_row, picture_row = image[c, first : first + patch], picture[c, first : first + patch]
            for i in range(patch):
                over = image_row[i] + max(cover_row[i], ZERO) * (ink[c] - image_row[i])
                image_row[i] = over
                picture_row[i] = np.uint8(over + HALF)
    return top * size + left


@compiled(NO_NAN)
def blend_vectors(image: Array, picture: Array, state: Array, scales: Array, inks: Array, size: int) -> None:
    """Blend the speed vectors of a state [S] over `image` and `picture`; arguments as `draw`."""
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


@compiled(RELAXED)
def restore_background(
    image: Array, background: Array, pixels: Array, pixel_step: int, squares: Array, patch: int, size: int
) -> None:
    """Copy `background` to `image`, both [C, P], along the line and in the squares of the target ships.

    `pixels` and `pixel_step` are from `cover_line`, `squares` [K] from `blend_ship`, which are `patch` wide.
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
def absolute_sum(row: Array) -> Number:
    """Return the sum of the absolute numbers of a state."""
    total = ZERO
    for i in range(row.shape[0]):
        total += abs(row[i])
    return total


@compiled(RELAXED)
def draw(
    states: Array,
    edges: Array,
    scales: Array,
    patch: int,
    size: int,
    inks: Array,
    background: Array,
    background_picture: Array,
    pictures: Array,
) -> None:
    """Draw N states, float32 [N, S], into `pictures`, uint8 [N, C, P].

    Inputs, float32 unless said otherwise: edges [E, 3] from `polygon_edges`, in pixels; scales [5]: pixels
    per metre, `reach` of `cover_line` (pixels), pixels of a speed vector per m/s, pixels from the middle of
    own ship and of a target ship to the bow; patch and size, widths in pixels of the square around a ship and
    of the picture; inks [3, C] of line, target ships and own ship; background [C, P], the picture without
    line and target ships; background_picture, the same in uint8.

    Raises:
        ValueError: a state is not finite, or larger than `MAX_STATE_SUM`.
    """
    scale, reach, vector_scale, _, _ = scales
    line_ink, ship_ink, _ = inks
    channels, half = background.shape[0], float32(size) * HALF
    # Line and ships are blended in floats. The pixels that they changed are restored before the next state.
    image = background.copy()
    line_cover, pixels = np.empty((STRIP_WIDTH, size // 2), np.float32), np.empty(size // 2, np.int32)
    cover, squares = np.empty(patch * patch, np.float32), np.empty(states.shape[1] // SHIP_SIZE, np.int32)
    column, row = np.empty_like(cover), np.empty_like(cover)
    for i in range(patch * patch):
        column[i], row[i] = float32(i % patch), float32(i // patch)
    for n in range(states.shape[0]):
        state, picture = states[n], pictures[n]
        for c in range(channels):
            copy(background_picture[c], picture[c])
        if not absolute_sum(state) < MAX_STATE_SUM:
            raise ValueError("a state to draw is not finite, or beyond 1e9")
        x, y = state[X], state[Y]
        turn = float32(math.pi / 2) - state[HEADING]
        across, ahead = math.cos(turn) * scale, math.sin(turn) * scale
        east, north = state[GOAL_X] - x, state[GOAL_Y] - y
        if abs(east) + abs(north) < MIN_GOAL_DISTANCE:
            east, north = ZERO, ZERO
        right, up = east * across - north * ahead, -(east * ahead + north * across)
        count, pixel_step = cover_line(right, up, reach, size, line_cover, pixels)
        blend_line(image, picture, background, line_ink, line_cover, pixels[:count], pixel_step)
        if vector_scale > 0:
            blend_vectors(image, picture, state, scales, inks, size)
        drawn = 0
        for k in range((state.shape[0] - OWN_SIZE) // SHIP_SIZE):
            if k >= state[SHIP_COUNT]:
                break
            ship = OWN_SIZE + SHIP_SIZE * k
            east, north = state[ship + SHIP_X] - x, state[ship + SHIP_Y] - y
            cx, cy = east * across - north * ahead + half, half - (east * ahead + north * across)
            heading = state[ship + SHIP_HEADING] + turn
            squares[k] = blend_ship(
                image, picture, ship_ink, cx, cy, heading, edges, size, column, row, cover
            )
            drawn = k + 1
        if vector_scale > 0:
            image[:] = background
        else:
            restore_background(image, background, pixels[:count], pixel_step, squares[:drawn], patch, size)


class CompiledDrawing:
    """`Rasteriser.reference` as a compiled loop on the CPU.

    `drawing(state)` maps floats [N, S] to uint8 [N, C, 84 * 84].
    """

    def __init__(self, rasteriser: Rasteriser) -> None:
        self._shape = rasteriser.canvas.shape
        bows = [length / 2 * scene.PIXELS_PER_METRE for length in (scene.OWN_LENGTH, scene.TARGET_LENGTH)]
        scales = scene.PIXELS_PER_METRE, 0.5 + scene.LINE_WIDTH / 2, rasteriser.vector_scale, *bows
        self._constants = (
            np.asarray(polygon_edges(rasteriser.outline), np.float32),
            np.asarray(scales, np.float32),
            scene.patch_size(),
            scene.SIZE,
            rasteriser.inks.numpy(),
            rasteriser.canvas.numpy(),
            rasteriser.background.flatten(1).numpy(),
        )

    def draw_into(self, state: Array, pictures: Array) -> None:
        """Draw states float32 [N, S] into `pictures`, uint8 [N, C, 84 * 84]; raise as `draw`."""
        draw(state, *self._constants, pictures)

    def __call__(self, state: Tensor) -> Tensor:
        """Draw states float [N, S]; return uint8 [N, C, 84 * 84]; raise as `draw`."""
        pictures = torch.empty(state.shape[0], *self._shape, dtype=torch.uint8, device="cpu")
        self.draw_into(state.detach().float().contiguous().numpy(), pictures.numpy())
        return pictures
