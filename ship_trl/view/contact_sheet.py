"""Draw all cases in one picture: as people see them, and as the network sees them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pygame
import torch

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition
from ship_trl.view import pen
from ship_trl.view.case_page import describe_classes, encounter_classes
from ship_trl.view.painter import draw_legend, draw_scene
from ship_trl.view.palette import BACKGROUND, FAINT, RULE, TEXT
from ship_trl.view.words import circle_names, counted

# Steps between the two moments shown: at the second one the ships of the paper's cases are near.
STEPS = 12
PICTURE = 3 * scene.SIZE
GAP, MARGIN, LABEL, HEAD, LEGEND = 12, 20, 176, 50, 58
WIDTH = 2 * MARGIN + LABEL + 4 * PICTURE + 3 * GAP


def write_contact_sheet(path: Path, cases: Sequence[Case], world: World) -> None:
    """Write a PNG with a row for each case.

    A row has the case's name, ideal path and encounter classes, a picture of the start, and one after keeping
    course for `STEPS` steps. The network's view of this moment follows, in grey and in colour.
    """
    bottom = HEAD + len(cases) * (PICTURE + GAP)
    sheet = pen.new_surface(WIDTH, bottom + LEGEND, BACKGROUND)
    time = f"after {STEPS * world.dt:g} s on this course"
    pixels = f"{scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}"
    heads = ("at the start", time, f"as the network sees it, {pixels}", "the same in colour")
    lefts = [MARGIN + LABEL + column * (PICTURE + GAP) for column in range(len(heads))]
    for left, head in zip(lefts, heads, strict=True):
        pen.write(sheet, head, (left, HEAD - 17), FAINT, 13)
    for row, case in enumerate(cases):
        top = HEAD + row * (PICTURE + GAP)
        width = LABEL - GAP
        pygame.draw.aaline(sheet, RULE, (MARGIN, top), (MARGIN + width - GAP, top))
        motion, start = Transition(world), initial_state(case, world)
        name, ships = f"case {case.name}", counted(len(case.target_ships), "target ship")
        lines = [(55, "ideal path", FAINT), (74, case.ideal_path, TEXT), (112, ships, FAINT)]
        if case.target_ships:
            classes = describe_classes(encounter_classes(start))
            lines += [(131 + 19 * k, text, colour) for k, (text, colour) in enumerate(classes)]
        pen.write(sheet, pen.cut(name, width, 20, True), (MARGIN, top + 25), TEXT, 20, True)
        for down, text, shade in lines:
            pen.write(sheet, pen.cut(text, width, 13), (MARGIN, top + down), shade, 13)
        straight, later = torch.tensor([world.straight_action]), start[None]
        for _ in range(STEPS):
            later = motion(later, straight).state
        pictures = [draw_scene(case, world, state, PICTURE, start) for state in (start, later[0])]
        for colour in (False, True):
            seen = make_rasteriser(world, colour=colour)(later[0]).numpy()
            pictures.append(pen.from_array(seen, PICTURE))
        for left, picture in zip(lefts, pictures, strict=True):
            sheet.blit(picture, (left, top))
    room = pygame.Rect(MARGIN, bottom, WIDTH - 2 * MARGIN, LEGEND)
    draw_legend(sheet, room, world, 13)
    expected, safe = circle_names(world)
    lengths = f"{scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
    text = f"the network sees hulls of {lengths}; around own ship, black: {safe}, red: {expected}"
    pen.write(sheet, text, (MARGIN, bottom + 38), FAINT, 13)
    pen.save(sheet, path)
