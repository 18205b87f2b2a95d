"""Text, lines and smooth shapes on a pygame surface.

pygame draws polygons and circles with hard edges at whole pixels. Here they are drawn four times as large
and averaged, so that motion looks smooth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pygame
from numpy.typing import NDArray
from PIL import Image

from ship_trl.files.disk import atomic_write
from ship_trl.view.style import Colour

Point = tuple[float, float]
OVERSAMPLING = 4


def new_surface(width: float, height: float, colour: Colour = (0, 0, 0)) -> pygame.Surface:
    """Make a surface of one colour without opening a display."""
    surface = pygame.Surface((width, height), depth=32)
    surface.fill(colour)
    return surface


def save(surface: pygame.Surface, path: Path) -> None:
    """Write a PNG atomically."""
    with atomic_write(path) as draft:
        Image.fromarray(to_array(surface)).save(draft, "PNG", optimize=True)


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """Copy the pixels of a surface: uint8 [H, W, 3], RGB."""
    # Three times as fast as `surfarray`, which has columns where others have rows.
    width, height = surface.get_size()
    return np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8).reshape(height, width, 3).copy()


def from_array(pixels: NDArray[np.uint8], side: int) -> pygame.Surface:
    """Enlarge pixels [C, S, S], grey or RGB, to a surface of `side` pixels with hard edges."""
    colour = np.broadcast_to(pixels, (3, *pixels.shape[1:]))
    return pygame.transform.scale(pygame.surfarray.make_surface(colour.T), (side, side))


def font(size: int, bold: bool = False) -> pygame.font.Font:
    """Return DejaVu Sans, which matplotlib brings to every machine; `size` is in pixels."""
    pygame.font.init()
    try:
        _open_font(size, bold).get_height()
    except pygame.error:
        # Whoever quits pygame, as closing a window does, makes all opened fonts invalid; surfaces stay valid.
        _open_font.cache_clear()
    return _open_font(size, bold)


@cache
def _open_font(size: int, bold: bool) -> pygame.font.Font:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return pygame.font.Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


@lru_cache(2000)
def _render(text: str, colour: Colour, size: int, bold: bool) -> pygame.Surface:
    return font(size, bold).render(text, True, colour)


def width_of(text: str, size: int, bold: bool = False) -> int:
    """Return the width of a text in pixels."""
    return font(size, bold).size(text)[0]


def cut(text: str, width: float, size: int, bold: bool = False, keeps_end: bool = False) -> str:
    """Shorten a text to `width` pixels, with an ellipsis at its end or, if `keeps_end`, in front."""
    if width_of(text, size, bold) <= width:
        return text
    while text and width_of(text + "…", size, bold) > width:
        text = text[1:] if keeps_end else text[:-1]
    return "…" + text.lstrip() if keeps_end else text.rstrip() + "…"


def write(
    surface: pygame.Surface,
    text: str,
    at: Point,
    colour: Colour,
    size: int,
    bold: bool = False,
    across: float = 0.0,
) -> float:
    """Write a line, and return the x of its end.

    It begins at `at` if `across` is 0, is centred there if it is 0.5, and ends there if it is 1.
    """
    rendered = _render(text, colour, size, bold)
    left = at[0] - across * rendered.get_width()
    surface.blit(rendered, (round(left), round(at[1] - rendered.get_height() / 2)))
    return left + rendered.get_width()


def flow(surface: pygame.Surface, items: Iterable[tuple[Colour, str]], room: pygame.Rect, size: int) -> float:
    """Write words from the top left of a room, in as many lines as needed; return the y of their end."""
    x, y = float(room.left), room.top + 0.95 * size
    for colour, words in items:
        if x > room.left and x + width_of(words, size) > room.right:
            x, y = float(room.left), y + 1.5 * size
        x = write(surface, cut(words, room.right - x, size), (x, y), colour, size) + 1.1 * size
    return y + size


def strip(surface: pygame.Surface, colour: Colour, start: Point, end: Point, width: float) -> None:
    """Draw a smooth line with square ends, of any width."""
    length = math.dist(start, end) or 1.0
    right, down = width / 2 * (start[1] - end[1]) / length, width / 2 * (end[0] - start[0]) / length
    sides = ((start, 1), (end, 1), (end, -1), (start, -1))
    polygon(surface, colour, [(x + side * right, y + side * down) for (x, y), side in sides])


def polyline(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], width: int = 1, dash: float = 0.0
) -> None:
    """Draw a smooth line through points, in dashes of `dash` pixels unless it is 0."""
    x, y = np.transpose(points)
    along = np.concatenate(([0.0], np.hypot(np.diff(x), np.diff(y)).cumsum()))
    cuts = np.union1d(along, np.arange(0.0, along[-1], dash)) if dash else along
    places = np.stack((np.interp(cuts, along, x), np.interp(cuts, along, y)), 1).tolist()
    for k, (start, end) in enumerate(pairwise(places)):
        is_gap = dash and (cuts[k] + cuts[k + 1]) / 2 // dash % 2 == 1
        if not is_gap:
            pygame.draw.aaline(surface, colour, start, end, width)


def polygon(surface: pygame.Surface, colour: Colour, corners: Sequence[Point], width: float = 0.0) -> None:
    """Fill a polygon, or draw its outline of `width` pixels."""
    across, down = zip(*corners, strict=True)
    left, top = math.floor(min(across)) - 2, math.floor(min(down)) - 2
    box = pygame.Rect(left, top, math.ceil(max(across)) + 3 - left, math.ceil(max(down)) + 3 - top)
    if not box.colliderect(surface.get_clip()):
        return
    places = [((x - left) * OVERSAMPLING, (y - top) * OVERSAMPLING) for x, y in corners]
    large = _transparent(colour, box.size)
    pygame.draw.polygon(large, colour, places, round(width * OVERSAMPLING))
    surface.blit(pygame.transform.smoothscale(large, box.size), box)


def circle(surface: pygame.Surface, colour: Colour, middle: Point, radius: float, width: float = 0.0) -> None:
    """Fill a circle, or draw its rim of `width` pixels."""
    (x, right), (y, down) = (divmod(math.floor(value * OVERSAMPLING), OVERSAMPLING) for value in middle)
    reach = math.ceil(radius) + 2
    surface.blit(_circle(colour, radius, width, right, down), (x - reach, y - reach))


@lru_cache(2000)
def _circle(colour: Colour, radius: float, width: float, right: int, down: int) -> pygame.Surface:
    """Draw a circle whose middle is `right` and `down` quarters of a pixel from the surface's middle."""
    reach = math.ceil(radius) + 2
    size = (2 * reach + 1, 2 * reach + 1)
    large = _transparent(colour, size)
    middle = (reach * OVERSAMPLING + right, reach * OVERSAMPLING + down)
    pygame.draw.circle(large, colour, middle, radius * OVERSAMPLING, math.ceil(width * OVERSAMPLING))
    return pygame.transform.smoothscale(large, size)


def _transparent(colour: Colour, size: tuple[int, int]) -> pygame.Surface:
    """Make an oversampled transparent surface of a colour: averaged with black, edges would turn dark."""
    large = pygame.Surface((size[0] * OVERSAMPLING, size[1] * OVERSAMPLING), pygame.SRCALPHA)
    large.fill((*colour, 0))
    return large
