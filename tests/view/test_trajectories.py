"""The chart of where everybody sailed."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case, load_case
from ship_trl.view.trajectories import COLOURS, TOGETHER, Path2D, draw_trajectories
from tests.view.sailing import sail


@pytest.fixture
def case(world: World) -> Case:
    return load_case("4", world)


def has(path: Path, colour: str) -> int:
    """How many pixels are of a colour."""
    with Image.open(path) as opened:
        pixels = np.asarray(opened.convert("RGB"))
    rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(pixels.astype(int) - rgb).max(-1) < 12).sum())


def draw(path: Path, case: Case, world: World, groups: Mapping[str, Sequence[Episode]]) -> Path:
    draw_trajectories(path, case, world, groups)
    return path


def test_each_group_has_a_line_and_a_place_in_the_legend(case: Case, world: World, tmp_path: Path) -> None:
    plans = {"a": (3,), "b": (0, 3), "c": (6, 3, 3)}
    groups = {name: [sail(case, world, plan)] for name, plan in plans.items()}
    together = draw(tmp_path / "together.png", case, world, groups)
    for k in range(3):
        assert has(together, COLOURS[k]) > 300
    alone = draw(tmp_path / "alone.png", case, world, {"a": groups["a"]})
    assert has(alone, COLOURS[0]) > 300 and not has(alone, COLOURS[2])


def test_many_groups_have_a_panel_each(case: Case, world: World, tmp_path: Path) -> None:
    one = sail(case, world, (3, 4))
    few = draw(tmp_path / "few.png", case, world, {f"g{k}": [one] for k in range(TOGETHER)})
    many = draw(tmp_path / "many.png", case, world, {f"g{k}": [one] for k in range(TOGETHER + 3)})
    # The same colour in each of them, as the place tells them apart.
    assert has(few, COLOURS[1]) > 100 and has(many, COLOURS[0]) > 3 * 300 and not has(many, COLOURS[1])


def test_seeds_of_a_group_are_drawn_each(case: Case, world: World, tmp_path: Path) -> None:
    one, other = sail(case, world, (3,)), sail(case, world, (0, 3, 6))
    single = draw(tmp_path / "single.png", case, world, {"a": [one]})
    both = draw(tmp_path / "both.png", case, world, {"a": [one, other]})
    assert single.read_bytes() != both.read_bytes()


def test_a_case_without_ships(world: World, tmp_path: Path) -> None:
    case = load_case("1", world)
    assert (
        has(draw(tmp_path / "one.png", case, world, {"$a_b$": [sail(case, world, (3,))]}), COLOURS[0]) > 100
    )


def test_the_closest_approach_is_within_steps_too() -> None:
    # A ship that crosses own ship's bow between two steps.
    own = np.array([[0.0, 0.0], [0.0, 10.0]])
    ships = np.array([[[-10.0, 5.0]], [[10.0, 5.0]]])
    found = Path2D(own, ships, "goal").nearest()
    assert found is not None
    assert found[0] == pytest.approx((0.0, 5.0)) and found[1] == pytest.approx((0.0, 5.0))
    assert Path2D(own, np.zeros((2, 0, 2)), "goal").nearest() is None
