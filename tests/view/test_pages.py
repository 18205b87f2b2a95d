"""Pages of small pictures: what each shows, where, and in which order."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.policies.named import rollout_entry
from ship_trl.policies.registry import Entry
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_suite, load_world
from ship_trl.sim.encounter import Encounter
from ship_trl.sim.starts import Starts
from ship_trl.sim.state import initial_state
from ship_trl.view import pages, pen
from ship_trl.view.style import BACKGROUND, OUTCOMES, YELLOW


def read(path: Path) -> NDArray[np.uint8]:
    assert [found.name for found in path.parent.iterdir()] == [path.name]
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_every_case_has_a_picture_and_a_caption(world: World, tmp_path: Path) -> None:
    suite, side = load_suite("imazu", world), 278
    names = [case.name for case in suite.cases]
    pages.write_case_page(tmp_path / "page.png", names, Starts(suite, world).states, world)
    page = read(tmp_path / "page.png")
    # A picture is water, whose colour is nowhere else.
    water = (page == scene.DISC).all(-1)
    for column in range(pages.STARTS):
        left = pages.MARGIN + column * (side + pages.GAP)
        rows = water[:, left + 2].nonzero()[0]
        # The lines of the grid are thinner than a caption.
        tops = [rows[0], *rows[np.flatnonzero(np.diff(rows) > 5) + 1]]
        assert len(tops) == len(names[column :: pages.STARTS])
        for top in tops:
            picture = page[top : top + side, left : left + side]
            assert (picture == scene.TARGET).all(-1).any() and (picture == scene.OWN).all(-1).any()
            assert (page[top + side + 2 : top + side + 40, left : left + side] != BACKGROUND).any()


def test_a_caption_counts_the_ships_of_each_class(world: World, make_case: Callable[..., Case]) -> None:
    crossing, ahead, port = (300, 300, 180, 15), (0, 600, -90, 15), (-300, 300, 0, 15)
    state = initial_state(make_case(crossing, ahead, crossing), world, places=5)
    assert pages.encounter_classes(state) == [Encounter.GIVE_WAY, Encounter.HEAD_ON, Encounter.GIVE_WAY]
    assert [text for text, *_ in pages.class_captions(state)] == ["head-on", "give way, 2 ships"]
    assert pages.encounter_classes(initial_state(make_case(port), world)) == [Encounter.STAND_ON]
    assert pages.class_captions(initial_state(make_case(), world))[0][0] == "no target ships"
    assert set(pages.CLASSES) == set(Encounter)


def test_a_way_ends_where_a_ship_will_be(world: World, make_case: Callable[..., Case]) -> None:
    state = initial_state(make_case((-300.0, 500.0, 0.0, 15.0)), world)
    picture = pen.to_array(pages.draw_start(state, world, 200, 800.0))
    # The middle is (0, 300), a pixel 4 m: 20 s later the target ship is at (0, 500), own ship at (0, 300).
    colour = pages.CLASSES[pages.encounter_classes(state)[0]][1]
    assert tuple(picture[50, 98]) == colour and tuple(picture[50, 60]) == colour
    assert tuple(picture[50, 104]) != colour
    assert tuple(picture[102, 100]) == scene.OWN and tuple(picture[92, 100]) != scene.OWN


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    world = load_world()
    return rollout_entry(Entry("keep_course", "", load_suite("paper", world), world, colour=False))[2]


def count_pixels(picture: NDArray[np.uint8], outcome: str) -> int:
    return int((np.abs(picture.astype(int) - OUTCOMES[outcome]).sum(-1) < 9).sum())


def test_a_path_to_the_goal_is_white_and_a_failure_has_its_colour(
    world: World, episodes: list[Episode]
) -> None:
    for episode in episodes[1:3]:
        picture = pen.to_array(pages.draw_paths(episode, world, 140, 800.0))
        white = int((picture == scene.OWN).all(-1).sum())
        assert white > 30 if episode.goal else count_pixels(picture, episode.outcome) > 30
        assert count_pixels(picture, "collision" if episode.goal else "goal") == 0


def test_failures_come_first_and_the_page_has_a_largest_size(
    world: World, tmp_path: Path, episodes: list[Episode]
) -> None:
    def page(name: str, some: list[Episode]) -> NDArray[np.uint8]:
        (tmp_path / name).mkdir()
        pages.write_episode_page(tmp_path / name / "page.png", "kept", ["x"] * len(some), some, world)
        return read(tmp_path / name / "page.png")

    shown = page("few", episodes)[50:]
    half = shown.shape[1] // 2
    # Four of seven collide: the left half of the page, below its title.
    assert count_pixels(shown[:, :half], "collision") > 100 and count_pixels(shown[:, :half], "goal") == 0
    assert count_pixels(shown[:, half:], "goal") > 30 and count_pixels(shown[:, half:], "collision") == 0
    many = 10 * episodes
    assert page("all", many).shape == page("most", many[: pages.MAX_PATHS]).shape


def test_a_page_of_failures_has_these_alone_with_their_closest_approach(
    world: World, tmp_path: Path, episodes: list[Episode]
) -> None:
    failed = [one for one in episodes if not one.goal]
    for name, some in (("all", episodes), ("failed", failed)):
        (tmp_path / name).mkdir()
        path = tmp_path / name / "page.png"
        pages.write_episode_page(path, "kept", ["x"] * len(some), some, world, failures=True)
    every, alone = read(tmp_path / "all/page.png"), read(tmp_path / "failed/page.png")
    assert every.shape == alone.shape and 0 < len(failed) < len(episodes)
    # Below the header, where all episodes are counted.
    assert (every[pages.MARGIN + 34 :] == alone[pages.MARGIN + 34 :]).all()
    assert (every != alone).any()
    pictures = (pages.draw_paths(failed[0], world, 268, 900.0, marks_closest=mark) for mark in (False, True))
    yellow = [(pen.to_array(picture) == YELLOW).all(-1).sum() for picture in pictures]
    assert yellow[0] == 0 and yellow[1] > 5


def test_a_footer_breaks_after_semicolons_where_it_is_too_wide() -> None:
    text = "north up; blue: goal; around own ship: safe distance"
    assert pages._wrap(text, 10_000, 13) == [text]
    lines = pages._wrap(text, pen.width_of("north up; blue: goal", 13), 13)
    assert lines == ["north up; blue: goal", "around own ship: safe distance"]
