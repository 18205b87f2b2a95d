"""Explain the shapes and colours of a painted scene."""

from __future__ import annotations

import pygame

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.painter import LEAST_PIXELS, TRUE_LENGTH, VECTOR_TIME
from ship_trl.view.palette import CHOSEN, DANGER, FAINT, GOAL_MARK, TEXT, Colour
from ship_trl.view.pen import Point


def draw_legend(
    surface: pygame.Surface, room: pygame.Rect, world: World, size: int, large: bool = False
) -> None:
    """Explain the scene from the top left of a room, in as many lines as needed.

    If `large`, hulls are as long as the network sees them.
    """
    hulls = f"hulls {TRUE_LENGTH:g} m, at least {LEAST_PIXELS:g} pixels"
    if large:
        hulls = f"hulls as for the network, {scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
    items = [
        (scene.OWN, "ship", "own ship"),
        (scene.TARGET, "ship", "target ship"),
        (GOAL_MARK, "ring", f"goal, {world.goal_distance:g} m"),
        (FAINT, "ring", f"safe distance {world.safe_distance:g} m"),
        (DANGER, "ring", "entered"),
        (scene.TARGET, "line", f"{VECTOR_TIME:g} s ahead"),
        (scene.OWN, "dots", f"track, {world.dt:g} s apart"),
        (CHOSEN, "", hulls),
    ]
    x, y = float(room.left), room.top + 0.95 * size
    for colour, shape, words in items:
        sample = 1.9 * size if shape else 0.0
        if x > room.left and x + sample + pen.width_of(words, size) > room.right:
            x, y = float(room.left), y + 1.5 * size
        if shape:
            _draw_sample(surface, colour, shape, (x + 0.7 * size, y), size)
        text = pen.cut(words, room.right - x - sample, size)
        x = pen.write(surface, text, (x + sample, y), TEXT if shape else colour, size) + 1.1 * size


def _draw_sample(surface: pygame.Surface, colour: Colour, shape: str, at: Point, size: int) -> None:
    """Draw a small ship, ring, line or track."""
    x, y = at
    if shape == "ship":
        pen.polygon(surface, colour, [(x - v, y - u) for u, v in scene.ship_outline(1.15 * size)])
    elif shape == "ring":
        pen.circle(surface, colour, at, 0.55 * size, 2)
    elif shape == "line":
        across, up = 0.6 * size, 0.4 * size
        pygame.draw.aaline(surface, colour, (x - across, y + up), (x + across, y - up), 2)
    else:
        for k in (-1, 0, 1):
            pen.circle(surface, colour, (x + 0.5 * k * size, y), 0.13 * size)
