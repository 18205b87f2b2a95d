"""Draw the starts of many cases on one page, north up, with each ship's way ahead and encounter class."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import pygame
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.encounter import (
    Encounter,
    are_ruled,
    classify,
    own_velocity,
    relative_motion,
    ship_velocities,
)
from ship_trl.sim.state import HEADING, SHIP_COUNT, SHIP_HEADING, SHIP_Y, goal, position, target_ships
from ship_trl.view import pen
from ship_trl.view.painter import MARGIN as AROUND
from ship_trl.view.painter import Projection, draw_goal, draw_safe_ring, draw_water, hull_length
from ship_trl.view.palette import BACKGROUND, FAINT, TEXT, YELLOW, Colour
from ship_trl.view.words import circle_names

# Pixels. A caption has the name, and a line for each class of encounter.
WIDTH, MARGIN, GAP, COLUMNS = 1200, 16, 16, 5
PICTURE = (WIDTH - 2 * MARGIN - (COLUMNS - 1) * GAP) // COLUMNS
NAME, LINE = 22, 17
# Seconds of the way ahead.
AHEAD = 20.0
CLASSES: dict[Encounter, tuple[str, Colour]] = {
    Encounter.HEAD_ON: ("head-on", (255, 110, 100)),
    Encounter.GIVE_WAY: ("give way", (245, 178, 66)),
    Encounter.STAND_ON: ("stand on", (86, 180, 233)),
    Encounter.OVERTAKING: ("overtaking", YELLOW),
    Encounter.OVERTAKEN: ("overtaken", (215, 140, 185)),
    Encounter.NONE: ("no encounter", FAINT),
}


def encounter_classes(state: Tensor) -> list[Encounter]:
    """Return the encounter class of each target ship in a state [S]."""
    motion = relative_motion(state.double())
    found = (classify(motion.bearing, motion.aspect) * are_ruled(state, motion)).tolist()
    return [Encounter(one) for one in found[: int(state[SHIP_COUNT])]]


def describe_classes(classes: Sequence[Encounter]) -> list[tuple[str, Colour]]:
    """Return a text and a colour for each class that occurs, such as "give way, 2 ships"."""
    found = [(classes.count(one), *about) for one, about in CLASSES.items() if one in classes]
    return [(name + (f", {count} ships" if count > 1 else ""), colour) for count, name, colour in found] or [
        ("no target ships", FAINT)
    ]


def write_case_page(path: Path, names: Sequence[str], states: Tensor, world: World) -> None:
    """Write a PNG with a picture, a name and the encounter classes of each state [N, S].

    All pictures have one scale, and the middle of the way from start to goal in the middle.
    """
    captions = [describe_classes(encounter_classes(state)) for state in states]
    lines = [max(map(len, captions[k : k + COLUMNS])) for k in range(0, len(captions), COLUMNS)]
    tops = list(accumulate((PICTURE + NAME + LINE * count + GAP for count in lines), initial=MARGIN))
    page = pen.new_surface(WIDTH, tops[-1] + 2 * LINE + MARGIN, BACKGROUND)
    width = 2 * (max(map(_reach, states)) + AROUND)
    for place, (name, state) in enumerate(zip(names, states, strict=True)):
        left, top = MARGIN + place % COLUMNS * (PICTURE + GAP), tops[place // COLUMNS]
        page.blit(draw_start(state, world, PICTURE, width), (left, top))
        down = top + PICTURE + 0.55 * NAME
        pen.write(page, pen.cut(name, PICTURE, 16, True), (left, down), TEXT, 16, True)
        for text, colour in captions[place]:
            down += LINE
            pen.write(page, text, (left, down), colour, 13)
    _draw_key(page, tops[-1], world, width)
    pen.save(page, path)


def draw_start(state: Tensor, world: World, side: int, width: float) -> pygame.Surface:
    """Draw a state [S] as a square of `width` metres; the colour of a ship's way is that of its class."""
    classes = encounter_classes(state)
    x, y = ((position(state) + goal(state)) / 2).tolist()
    frame = Projection(x, y, math.pi / 2, side, side / width)
    own, ships = state[: HEADING + 1], target_ships(state)[: len(classes), : SHIP_HEADING + 1]
    poses = torch.cat((own[None], ships)).double().numpy()
    ways = torch.cat((own_velocity(state)[None], ship_velocities(state)[: len(classes)])).double().numpy()
    picture = draw_water(frame).copy()
    draw_goal(picture, frame, world, poses[0, :2], goal(state).double().numpy())
    draw_safe_ring(picture, frame, world, poses[0])
    colours = [scene.OWN, *(CLASSES[one][1] for one in classes)]
    for pose, way, colour in zip(poses, ways, colours, strict=True):
        ahead = frame.point(*(pose[:2] + AHEAD * way))
        pen.strip(picture, colour, frame.point(*pose[:2]), ahead, 2)
        pen.circle(picture, colour, ahead, 3)
    for pose, colour in zip(poses, [scene.OWN, *[scene.TARGET] * len(ships)], strict=True):
        pen.polygon(picture, colour, frame.hull(pose, hull_length(world, frame.scale)))
    return picture


def _reach(state: Tensor) -> float:
    """Return how far (m, along x or y) anything in a state [S] is from the middle of start and goal."""
    ships = target_ships(state)[: int(state[SHIP_COUNT]), : SHIP_Y + 1]
    middle = (position(state) + goal(state)) / 2
    return float((torch.cat((position(state)[None], ships)) - middle).abs().max())


def _draw_key(page: pygame.Surface, top: float, world: World, width: float) -> None:
    """Explain the pictures below them."""
    expected, safe = circle_names(world)
    first = f"north up, width {width:.0f} m; lines: {AHEAD:g} s on course, in the colour of the class"
    hull = hull_length(world, PICTURE / width)
    around = f"blue: goal, {expected}; around own ship: {safe}"
    second = f"{around}; hulls drawn {hull:.0f} m long; classes by Pedersen's sectors"
    for place, text in enumerate((first, second)):
        pen.write(page, text, (MARGIN, top + (place + 0.5) * LINE), FAINT, 13)
