"""All cases in one picture: as people see them, and beside that what the network sees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pygame
import torch
from PIL import Image

from ship_trl.config.types import World
from ship_trl.files.disk import atomic_write
from ship_trl.policies.named import straight_action
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition
from ship_trl.view import pen
from ship_trl.view.painter import draw_legend, draw_scene
from ship_trl.view.palette import BACKGROUND, FAINT, RULE, TEXT
from ship_trl.view.words import counted

# Steps of keeping course until the later moment: by then the ships of the paper's cases are near.
LATER = 12
PICTURE = 3 * scene.SIZE
GAP, MARGIN, LABEL, HEAD, LEGEND = 12, 20, 176, 50, 36
WIDTH = 2 * MARGIN + LABEL + 4 * PICTURE + 3 * GAP


def write_contact_sheet(path: Path, cases: Sequence[Case], world: World) -> None:
    """Write a PNG with a row for each case.

    Left to right: name and ideal path; the start and `LATER` steps of keeping course further, as
    people see them; that later moment as the network sees it, in grey and in colour.

    Raises:
        OSError: the file cannot be written.
    """
    bottom = HEAD + len(cases) * (PICTURE + GAP)
    sheet = pen.new_surface(WIDTH, bottom + LEGEND)
    sheet.fill(BACKGROUND)
    time = f"after {LATER * world.dt:g} s on this course"
    pixels = f"{scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}"
    heads = ("at the start", time, f"the same, network's view, {pixels}", "the same in colour")
    lefts = [MARGIN + LABEL + column * (PICTURE + GAP) for column in range(len(heads))]
    for left, head in zip(lefts, heads, strict=True):
        pen.write(sheet, head, (left, HEAD - 17), FAINT, 13)
    for row, case in enumerate(cases):
        top = HEAD + row * (PICTURE + GAP)
        _write_label(sheet, case, top)
        motion = Transition(case, world, torch.device("cpu"))
        straight = torch.tensor([straight_action(world)])
        later = motion.start[None]
        for _ in range(LATER):
            later = motion(later, straight).state
        pictures = [draw_scene(case, world, state, PICTURE) for state in (motion.start, later[0])]
        for colour in (False, True):
            seen = Rasteriser(case, world, colour=colour)(later[0]).numpy()
            pictures.append(pen.from_array(seen, PICTURE))
        for left, picture in zip(lefts, pictures, strict=True):
            sheet.blit(picture, (left, top))
    room = pygame.Rect(MARGIN, bottom, WIDTH - 2 * MARGIN, LEGEND)
    draw_legend(sheet, room, world, 13, scale=PICTURE / (2 * scene.WINDOW))
    with atomic_write(path) as draft:
        Image.fromarray(pen.to_array(sheet)).save(draft, "PNG", optimize=True)


def _write_label(sheet: pygame.Surface, case: Case, top: int) -> None:
    width = LABEL - GAP
    pen.line(sheet, RULE, (MARGIN, top), (MARGIN + width - GAP, top))
    pen.write(sheet, pen.cut(f"case {case.name}", width, 20, True), (MARGIN, top + 25), TEXT, 20, True)
    ships = counted(len(case.target_ships), "target ship")
    for down, text, colour in ((55, "ideal path", FAINT), (74, case.ideal_path, TEXT), (112, ships, FAINT)):
        pen.write(sheet, pen.cut(text, width, 13), (MARGIN, top + down), colour, 13)
