"""The page of many cases: a picture and the classes of encounter of each start."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.encounter import Encounter
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import initial_state
from ship_trl.sim.suites import load_suite
from ship_trl.view import pen
from ship_trl.view.case_page import (
    CLASSES,
    COLUMNS,
    GAP,
    MARGIN,
    PICTURE,
    WIDTH,
    describe_classes,
    draw_start,
    encounter_classes,
    write_case_page,
)
from ship_trl.view.palette import BACKGROUND


def test_every_case_has_a_picture_and_a_caption(world: World, tmp_path: Path) -> None:
    suite = load_suite("imazu", world)
    names = [case.name for case in suite.cases]
    write_case_page(tmp_path / "page.png", names, Starts(suite, world).states, world)
    assert [path.name for path in tmp_path.iterdir()] == ["page.png"]
    with Image.open(tmp_path / "page.png") as image:
        page = np.asarray(image.convert("RGB"))
    assert page.shape[1] == WIDTH
    # A picture is water, whose colour is nowhere else.
    water = (page == scene.DISC).all(-1)
    for column in range(COLUMNS):
        left = MARGIN + column * (PICTURE + GAP)
        rows = water[:, left + 2].nonzero()[0]
        # The lines of the grid are thinner than a caption.
        breaks = np.flatnonzero(np.diff(rows) > 5)
        tops = [rows[0], *rows[breaks + 1]]
        assert len(tops) == len(names[column::COLUMNS])
        for top in tops:
            picture = page[top : top + PICTURE, left : left + PICTURE]
            assert (picture == scene.TARGET).all(-1).any() and (picture == scene.OWN).all(-1).any()
            caption = page[top + PICTURE + 2 : top + PICTURE + 40, left : left + PICTURE]
            assert (caption != BACKGROUND).any()


def test_a_caption_counts_the_ships_of_each_class(world: World, make_case: Callable[..., Case]) -> None:
    crossing, ahead, port = (300, 300, 180, 15), (0, 600, -90, 15), (-300, 300, 0, 15)
    case = make_case(crossing, ahead, crossing)
    found = encounter_classes(initial_state(case, world, places=5))
    assert found == [Encounter.GIVE_WAY, Encounter.HEAD_ON, Encounter.GIVE_WAY]
    assert [text for text, _ in describe_classes(found)] == ["head-on", "give way, 2 ships"]
    assert encounter_classes(initial_state(make_case(port), world)) == [Encounter.STAND_ON]
    assert describe_classes([])[0][0] == "no target ships"
    anchored, alike = (0, 300, -90, 0), (100, 0, 90, 15)
    assert encounter_classes(initial_state(make_case(anchored, alike), world)) == [Encounter.NONE] * 2
    assert set(CLASSES) == set(Encounter)


def test_a_way_ends_where_a_ship_will_be(world: World, make_case: Callable[..., Case]) -> None:
    state = initial_state(make_case((-300.0, 500.0, 0.0, 15.0)), world)
    picture = pen.to_array(draw_start(state, world, 200, 800.0))
    # The middle is (0, 300), a pixel 4 m: 20 s later the target ship is at (0, 500), own ship at (0, 300).
    colour = CLASSES[encounter_classes(state)[0]][1]
    assert tuple(picture[50, 98]) == colour and tuple(picture[50, 60]) == colour
    assert tuple(picture[50, 104]) != colour
    assert tuple(picture[102, 100]) == scene.OWN and tuple(picture[92, 100]) != scene.OWN
