"""Explain the shapes and colours of a painted scene."""

from __future__ import annotations

import pygame

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.painter import TRUE_LENGTH
from ship_trl.view.palette import CHOSEN, RULE, TEXT, Colour
from ship_trl.view.pen import Point
from ship_trl.view.words import circle_names


def draw_legend(
    surface: pygame.Surface,
    room: pygame.Rect,
    world: World,
    size: int,
    to_scale: bool = False,
    plain: bool = False,
    vector_time: float = 0.0,
) -> None:
    """Explain the scene from the top left of a room, in as many lines as needed.

    The options are those of `painter.paint_scene`.
    """
    if to_scale:
        hulls = f"hulls to scale, {TRUE_LENGTH:g} m; outline: as drawn for the network"
    else:
        drawn = f"{scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
        hulls = f"hulls drawn {drawn} long, to scale {TRUE_LENGTH:g} m"
    expected, safe = circle_names(world)
    track = (scene.OWN, "dots", f"track, {world.dt:g} s apart")
    items = [
        (scene.OWN, "ship", "own ship"),
        (scene.TARGET, "ship", "target ship"),
        (scene.GOAL_CIRCLE, "disc", expected),
        (scene.SAFE_CIRCLE, "disc", safe),
        (scene.LINE, "line", "to the goal"),
        *([(scene.TARGET, "line", f"speed vector, {vector_time:g} s")] if vector_time else []),
        (TEXT, "", f"width {2 * scene.VIEW_RADIUS:g} m") if plain else track,
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
    """Draw a small ship, disc, line or track."""
    x, y = at
    if shape == "ship":
        pen.polygon(surface, colour, [(x - v, y - u) for u, v in scene.ship_outline(1.15 * size)])
    elif shape == "disc":
        pen.circle(surface, RULE, at, 0.55 * size + 1)
        pen.circle(surface, colour, at, 0.55 * size)
    elif shape == "line":
        across, up = 0.6 * size, 0.4 * size
        pygame.draw.aaline(surface, colour, (x - across, y + up), (x + across, y - up), 2)
    else:
        for k in (-1, 0, 1):
            pen.circle(surface, colour, (x + 0.5 * k * size, y), 0.13 * size)
