"""Letters, lines and smooth shapes on a pygame surface.

pygame's own polygons and circles have hard edges and whole pixels; what moves is drawn four times as large
on a small surface and averaged, so that it glides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path

import matplotlib
import pygame

Colour = tuple[int, int, int]
Point = tuple[float, float]
OVERSAMPLING = 4
# Okabe and Ito's, as they are told apart on a dark ground.
SKY, ORANGE, GREEN = (86, 180, 233), (230, 159, 0), (0, 190, 140)
YELLOW, VERMILION, PURPLE = (240, 228, 66), (235, 110, 40), (215, 140, 185)
SERIES = (SKY, ORANGE, GREEN, PURPLE, YELLOW, VERMILION)

pygame.font.init()


@cache
def letters(size: int, bold: bool = False) -> pygame.font.Font:
    """Open DejaVu Sans in `size` pixels. It comes with matplotlib, so every machine has the same."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return pygame.font.Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


@lru_cache(2000)
def _written(text: str, colour: Colour, size: int, bold: bool) -> pygame.Surface:
    return letters(size, bold).render(text, True, colour)


def width_of(text: str, size: int, bold: bool = False) -> int:
    """Measure a text in pixels."""
    return letters(size, bold).size(text)[0]


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
    """Write a text with the middle of its line at `at`; returns where it ends.

    Args:
        surface: where it goes.
        text: one line.
        at: x, y in pixels.
        colour: of the letters.
        size: in pixels.
        bold: whether it is bold.
        across: 0 to begin at x, 0.5 to stand over it, 1 to end there.
    """
    drawn = _written(text, colour, size, bold)
    left = at[0] - across * drawn.get_width()
    surface.blit(drawn, (round(left), round(at[1] - drawn.get_height() / 2)))
    return left + drawn.get_width()


def line(surface: pygame.Surface, colour: Colour, start: Point, end: Point, width: int = 1) -> None:
    """Draw a smooth line."""
    pygame.draw.aaline(surface, colour, start, end, width)


def polyline(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], width: int = 1, dash: float = 0.0
) -> None:
    """Draw a line through points, with dashes of so many pixels where `dash` is not 0."""
    walked = 0.0
    for start, end in pairwise(points):
        length = math.dist(start, end)
        done = 0.0
        while done < length:
            # A whole dash, or what is left of it on this piece.
            part = min(length - done, dash - walked % dash if dash else length)
            if part <= 1e-9:
                break
            if not dash or (walked // dash % 2 == 0 and part > 0.5):
                ends = [
                    (
                        start[0] + (end[0] - start[0]) * at / length,
                        start[1] + (end[1] - start[1]) * at / length,
                    )
                    for at in (done, done + part)
                ]
                pygame.draw.aaline(surface, colour, ends[0], ends[1], width)
            # A hair further, so that the next dash begins where this one ends.
            done, walked = done + part, walked + part + 1e-9


def polygon(surface: pygame.Surface, colour: Colour, corners: Sequence[Point], width: float = 0.0) -> None:
    """Fill a polygon, or draw its outline of `width` pixels."""
    right, down = [x for x, _ in corners], [y for _, y in corners]
    left, top = math.floor(min(right)) - 2, math.floor(min(down)) - 2
    box = pygame.Rect(left, top, math.ceil(max(right)) + 3 - left, math.ceil(max(down)) + 3 - top)
    if not box.colliderect(surface.get_clip()):
        return
    large = pygame.Surface((box.width * OVERSAMPLING, box.height * OVERSAMPLING), pygame.SRCALPHA)
    # The colour itself, unseen: edges would turn dark if they were averaged with black.
    large.fill((*colour, 0))
    places = [((x - left) * OVERSAMPLING, (y - top) * OVERSAMPLING) for x, y in corners]
    pygame.draw.polygon(large, colour, places, round(width * OVERSAMPLING))
    surface.blit(pygame.transform.smoothscale(large, box.size), box)


@lru_cache(2000)
def _round(colour: Colour, radius: float, width: float, right: int, down: int) -> pygame.Surface:
    """Draw a circle whose middle is `right` and `down` parts of a pixel from the middle of the surface."""
    reach = math.ceil(radius) + 2
    large = pygame.Surface(((2 * reach + 1) * OVERSAMPLING,) * 2, pygame.SRCALPHA)
    large.fill((*colour, 0))
    middle = (reach * OVERSAMPLING + right, reach * OVERSAMPLING + down)
    pygame.draw.circle(large, colour, middle, radius * OVERSAMPLING, math.ceil(width * OVERSAMPLING))
    return pygame.transform.smoothscale(large, (2 * reach + 1,) * 2)


def circle(surface: pygame.Surface, colour: Colour, middle: Point, radius: float, width: float = 0.0) -> None:
    """Fill a circle, or draw its rim of `width` pixels. Circles are kept, at each part of a pixel one."""
    (right, x), (down, y) = (divmod(math.floor(value * OVERSAMPLING), OVERSAMPLING) for value in middle)
    reach = math.ceil(radius) + 2
    surface.blit(_round(colour, radius, width, x, y), (right - reach, down - reach))


def blend(colour: Colour, ground: Colour, share: float) -> Colour:
    """Mix `share` of a colour into a ground."""
    red, green, blue = (round(g + share * (c - g)) for c, g in zip(colour, ground, strict=True))
    return red, green, blue
