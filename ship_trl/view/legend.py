"""What is what in a picture of the scene, in as many lines as its room needs."""

from __future__ import annotations

import pygame

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.palette import CHOSEN, RULE, TEXT, Colour
from ship_trl.view.words import expected_distance, hull_lengths, safe_distance

# Metres of the scale bar.
BAR = 200.0


def draw_legend(
    surface: pygame.Surface,
    room: pygame.Rect,
    world: World,
    size: int,
    to_scale: bool = False,
    scale: float = 0.0,
) -> None:
    """Draw the legend from the top left of a room.

    Args:
        surface: where it goes.
        room: its place.
        world: safe and expected distance, and seconds between the dots of a track.
        size: of the letters.
        to_scale: whether hulls are as long as ships are.
        scale: pixels per metre of pictures without scale bar and tracks; 0 where they have them.
    """
    items = [
        (scene.OWN, "ship", "own ship"),
        (scene.TARGET, "ship", "target ship"),
        (scene.GOAL_CIRCLE, "disc", expected_distance(world)),
        (scene.SAFE_CIRCLE, "disc", safe_distance(world)),
        (scene.LINE, "line", "to the goal"),
        (TEXT, "bar", f"{BAR:g} m") if scale else (scene.OWN, "dots", f"track, {world.dt:g} s apart"),
        (CHOSEN, "", hull_lengths(to_scale)),
    ]
    x, y = float(room.left), room.top + 0.95 * size
    for colour, shape, words in items:
        sample = BAR * scale + 0.7 * size if shape == "bar" else 1.9 * size if shape else 0.0
        if x > room.left and x + sample + pen.width_of(words, size) > room.right:
            x, y = float(room.left), y + 1.5 * size
        if shape == "bar":
            pen.scale_bar(surface, colour, (x, y + 4), BAR * scale)
        elif shape:
            draw_sample(surface, colour, shape, (x + 0.7 * size, y), size)
        text = pen.cut(words, room.right - x - sample, size)
        x = pen.write(surface, text, (x + sample, y), TEXT if shape else colour, size) + 1.1 * size


def draw_sample(surface: pygame.Surface, colour: Colour, shape: str, at: pen.Point, size: int) -> None:
    """Draw a thing of the scene small."""
    x, y = at
    if shape == "ship":
        pen.polygon(surface, colour, [(x - v, y - u) for u, v in scene.ship_outline(1.15 * size)])
    elif shape == "disc":
        pen.circle(surface, RULE, at, 0.55 * size + 1)
        pen.circle(surface, colour, at, 0.55 * size)
    elif shape == "line":
        pen.line(surface, colour, (x - 0.6 * size, y + 0.4 * size), (x + 0.6 * size, y - 0.4 * size), 2)
    else:
        for k in (-1, 0, 1):
            pen.circle(surface, colour, (x + 0.5 * k * size, y), 0.13 * size)
