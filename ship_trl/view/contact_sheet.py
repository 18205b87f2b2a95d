"""All cases in one picture: as people see them, and beside it what the network sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.files.disk import replacing
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import advance
from ship_trl.sim.render import Rasteriser
from ship_trl.view.draw import draw_scene, to_array
from ship_trl.view.legend import draw_legend
from ship_trl.view.lettering import FAINT, INK, PAPER, RULE, fit, font

# Steps of keeping course until the later moment: by then the ships of the paper's cases are near.
LATER = 12
PICTURE = 3 * scene.SIZE
GAP, MARGIN, LABEL, HEAD = 12, 20, 176, 50
WIDTH = 2 * MARGIN + LABEL + 4 * PICTURE + 3 * GAP


def write_contact_sheet(path: Path, cases: Sequence[Case], world: World) -> None:
    """Write a PNG with a row for each case.

    Left to right: name and ideal path; the start and `LATER` steps of keeping course further, as
    people see them; that later moment as the network sees it, in grey and in colour.

    Args:
        path: where it goes; written beside and renamed.
        cases: one or more.
        world: physics and the course-keeping action.

    Raises:
        OSError: the file cannot be written.
    """
    below = draw_legend(WIDTH - MARGIN, PICTURE, world)
    height = HEAD + len(cases) * (PICTURE + GAP) - GAP + MARGIN + below.height
    sheet = Image.new("RGB", (WIDTH, height), PAPER)
    pen = ImageDraw.Draw(sheet)
    time = f"after {LATER * world.dt:g} s on this course"
    pixels = f"{scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}"
    heads = ("at the start", time, f"the same, network's view, {pixels}", "the same in colour")
    for k, head in enumerate(heads):
        pen.text((_left(k), HEAD - 12), head, FAINT, font(13), anchor="ls")
    for row, case in enumerate(cases):
        top = HEAD + row * (PICTURE + GAP)
        _label(pen, case, top)
        start = torch.tensor([*case.start, math.radians(case.heading), 0.0])
        later = keep_course(start, world, LATER)
        grey, colour = (Rasteriser(case, world, colour=c)(later).numpy() for c in (False, True))
        for k, picture in enumerate(
            (
                Image.fromarray(to_array(draw_scene(case, world, start, PICTURE))),
                Image.fromarray(to_array(draw_scene(case, world, later, PICTURE))),
                Image.fromarray(grey[0]).convert("RGB"),
                Image.fromarray(np.moveaxis(colour, 0, -1)),
            )
        ):
            whole = picture.resize((PICTURE, PICTURE), Image.Resampling.NEAREST)
            sheet.paste(whole, (_left(k), top))
    sheet.paste(below, (MARGIN, height - MARGIN // 2 - below.height))
    with replacing(path) as draft:
        sheet.save(draft, optimize=True)


def keep_course(state: Tensor, world: World, steps: int) -> Tensor:
    """Where the fastest action of the least turn leads: float [4] to [4]."""
    actions = torch.tensor(world.actions)
    order = [(abs(turn), -speed) for speed, turn in world.actions]
    straight = torch.tensor(order.index(min(order)))
    for _ in range(steps):
        state = advance(state, straight, actions, world.dt)
    return state


def _left(column: int) -> int:
    return MARGIN + LABEL + column * (PICTURE + GAP)


def _label(pen: ImageDraw.ImageDraw, case: Case, top: int) -> None:
    width = LABEL - GAP
    pen.line((MARGIN, top, MARGIN + width - GAP, top), RULE)
    name, letters = fit(f"case {case.name}", width, 20, bold=True)
    pen.text((MARGIN, top + 32), name, INK, letters, anchor="ls")
    count = len(case.target_ships)
    ships = "no target ships" if count == 0 else "1 target ship" if count == 1 else f"{count} target ships"
    for line, what, colour in ((0, "ideal path", FAINT), (1, case.ideal_path, INK), (3, ships, FAINT)):
        text, letters = fit(what, width, 13)
        pen.text((MARGIN, top + 60 + 19 * line), text, colour, letters, anchor="ls")
