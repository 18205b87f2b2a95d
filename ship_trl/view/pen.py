"""Text, lines and smooth shapes on a pygame surface.

pygame's own polygons and circles have hard edges and whole pixels. Here they are drawn four times as large
on a small surface and averaged, so that what moves glides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pygame
from numpy.typing import NDArray

from ship_trl.view.palette import Colour

Point = tuple[float, float]
OVERSAMPLING = 4

pygame.font.init()


def new_surface(width: float, height: float) -> pygame.Surface:
    """Make an empty surface without opening a display."""
    return pygame.Surface((width, height), depth=32)


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """Copy the pixels of a surface: uint8 [H, W, 3], RGB."""
    raw = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
    return raw.reshape(surface.get_height(), surface.get_width(), 3).copy()


def from_array(pixels: NDArray[np.uint8], side: int) -> pygame.Surface:
    """Enlarge pixels [C, S, S], grey or RGB, to a surface of `side` pixels with hard edges."""
    colour = np.ascontiguousarray(np.moveaxis(np.broadcast_to(pixels, (3, *pixels.shape[1:])), 0, -1))
    picture = pygame.image.frombuffer(colour.tobytes(), pixels.shape[:0:-1], "RGB")
    return pygame.transform.scale(picture, (side, side))


@cache
def font(size: int, bold: bool = False) -> pygame.font.Font:
    """Open DejaVu Sans in `size` pixels; it comes with matplotlib, so every machine has the same."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return pygame.font.Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


@lru_cache(2000)
def _written(text: str, colour: Colour, size: int, bold: bool) -> pygame.Surface:
    return font(size, bold).render(text, True, colour)


def width_of(text: str, size: int, bold: bool = False) -> int:
    """Measure a text in pixels."""
    return font(size, bold).size(text)[0]


def cut(text: str, width: float, size: int, bold: bool = False) -> str:
    """Cut a text to `width` pixels, with an ellipsis where something is missing."""
    if width_of(text, size, bold) <= width:
        return text
    while text and width_of(text + "…", size, bold) > width:
        text = text[:-1]
    return text.rstrip() + "…"


def write(
    surface: pygame.Surface,
    text: str,
    at: Point,
    colour: Colour,
    size: int,
    bold: bool = False,
    across: float = 0.0,
) -> float:
    """Write a line that begins at `at`, is centred on it (`across` 0.5) or ends there (1); return its end."""
    drawn = _written(text, colour, size, bold)
    left = at[0] - across * drawn.get_width()
    surface.blit(drawn, (round(left), round(at[1] - drawn.get_height() / 2)))
    return left + drawn.get_width()


def line(surface: pygame.Surface, colour: Colour, start: Point, end: Point, width: int = 1) -> None:
    """Draw a smooth line."""
    pygame.draw.aaline(surface, colour, start, end, width)


def strip(surface: pygame.Surface, colour: Colour, start: Point, end: Point, width: float) -> None:
    """Draw a smooth line with square ends, of any width."""
    length = math.dist(start, end) or 1.0
    right, down = width / 2 * (start[1] - end[1]) / length, width / 2 * (end[0] - start[0]) / length
    sides = ((start, 1), (end, 1), (end, -1), (start, -1))
    polygon(surface, colour, [(x + side * right, y + side * down) for (x, y), side in sides])


def scale_bar(surface: pygame.Surface, colour: Colour, at: Point, length: float) -> None:
    """Draw a bar of `length` pixels with upright ends; `at` is its lower left corner."""
    pygame.draw.rect(surface, colour, (at[0], at[1] - 3, length, 3))
    for left in (at[0], at[0] + length - 2):
        pygame.draw.rect(surface, colour, (left, at[1] - 8, 2, 8))


def polyline(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], width: int = 1, dash: float = 0.0
) -> None:
    """Draw a line through points, in dashes of `dash` pixels where that is not 0."""
    walked = 0.0
    for start, end in pairwise(points):
        length = math.dist(start, end)
        cuts = [0.0, length]
        if dash:
            # Where dashes and gaps begin and end on this piece.
            left = dash - walked % dash
            cuts[1:1] = [left + k * dash for k in range(math.ceil((length - left) / dash))]
        for begin, stop in pairwise(cuts):
            is_gap = dash and (walked + (begin + stop) / 2) // dash % 2 == 1
            if not is_gap and stop > begin:
                first = pygame.Vector2(start).lerp(end, begin / length)
                last = pygame.Vector2(start).lerp(end, stop / length)
                pygame.draw.aaline(surface, colour, first, last, width)
        walked += length


def polygon(surface: pygame.Surface, colour: Colour, corners: Sequence[Point], width: float = 0.0) -> None:
    """Fill a polygon, or draw its outline of `width` pixels."""
    across, down = [x for x, _ in corners], [y for _, y in corners]
    left, top = math.floor(min(across)) - 2, math.floor(min(down)) - 2
    box = pygame.Rect(left, top, math.ceil(max(across)) + 3 - left, math.ceil(max(down)) + 3 - top)
    if not box.colliderect(surface.get_clip()):
        return
    large = pygame.Surface((box.width * OVERSAMPLING, box.height * OVERSAMPLING), pygame.SRCALPHA)
    # The transparent ground has the same colour: averaged with black, edges would turn dark.
    large.fill((*colour, 0))
    places = [((x - left) * OVERSAMPLING, (y - top) * OVERSAMPLING) for x, y in corners]
    pygame.draw.polygon(large, colour, places, round(width * OVERSAMPLING))
    surface.blit(pygame.transform.smoothscale(large, box.size), box)


@lru_cache(2000)
def _disc(colour: Colour, radius: float, width: float, right: int, down: int) -> pygame.Surface:
    """Draw a circle whose middle is `right` and `down` quarters of a pixel from the surface's middle."""
    reach = math.ceil(radius) + 2
    large = pygame.Surface(((2 * reach + 1) * OVERSAMPLING,) * 2, pygame.SRCALPHA)
    large.fill((*colour, 0))
    middle = (reach * OVERSAMPLING + right, reach * OVERSAMPLING + down)
    pygame.draw.circle(large, colour, middle, radius * OVERSAMPLING, math.ceil(width * OVERSAMPLING))
    return pygame.transform.smoothscale(large, (2 * reach + 1,) * 2)


def circle(surface: pygame.Surface, colour: Colour, middle: Point, radius: float, width: float = 0.0) -> None:
    """Fill a circle, or draw its rim of `width` pixels; each is cached, by quarters of a pixel."""
    (x, right), (y, down) = (divmod(math.floor(value * OVERSAMPLING), OVERSAMPLING) for value in middle)
    reach = math.ceil(radius) + 2
    surface.blit(_disc(colour, radius, width, right, down), (x - reach, y - reach))
