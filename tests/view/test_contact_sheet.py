"""The contact sheet: a row for each case, at the start and on course."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, case_names, load_case
from ship_trl.view.contact_sheet import (
    GAP,
    HEAD,
    LABEL,
    LEGEND,
    MARGIN,
    PICTURE,
    WIDTH,
    write_contact_sheet,
)
from tests.sim.scenes import scenes


def test_every_case_has_a_row(world: World, tmp_path: Path) -> None:
    cases = [load_case(name, world) for name in case_names()]
    path = tmp_path / "cases.png"
    write_contact_sheet(path, cases, world)
    assert [p.name for p in tmp_path.iterdir()] == ["cases.png"]
    with Image.open(path) as image:
        assert image.size == (WIDTH, HEAD + len(cases) * (PICTURE + GAP) + LEGEND)
        sheet = np.asarray(image.convert("RGB"))
    green = (sheet == scene.TARGET).all(-1)
    for row, case in enumerate(cases):
        top = HEAD + row * (PICTURE + GAP)
        for column in (0, 1, 3):
            left = MARGIN + LABEL + column * (PICTURE + GAP)
            shown = green[top : top + PICTURE, left : left + PICTURE].any()
            assert shown == bool(case.target_ships), (case.name, column)


def test_the_networks_view_is_three_times_its_size(
    world: World, tmp_path: Path, make_case: Callable[..., Case]
) -> None:
    case = make_case((-300.0, 150.0, 0.0, 15.0))
    write_contact_sheet(tmp_path / "cases.png", [case], world)
    with Image.open(tmp_path / "cases.png") as image:
        sheet = np.asarray(image.convert("RGB"))
    left = MARGIN + LABEL + 2 * (PICTURE + GAP)
    shown = sheet[HEAD : HEAD + PICTURE, left : left + PICTURE, 0]
    seen = make_rasteriser(world)(scenes(case, world, [[0.0, 180.0, np.pi / 2, 12.0]]))[0, 0].numpy()
    # One millimetre of rounding in the place may move a grey level by one.
    assert np.abs(shown[1::3, 1::3].astype(int) - seen).max() <= 1
    assert (shown.reshape(84, 3, 84, 3) == shown[1::3, 1::3][:, None, :, None]).all()
