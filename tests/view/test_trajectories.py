"""The chart of paths."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case, load_case
from ship_trl.view.palette import CHART_SERIES
from ship_trl.view.trajectories import MAX_TOGETHER, draw_trajectories
from tests.view.episodes import run_actions

FIRST, SECOND, THIRD = CHART_SERIES[:3]


@pytest.fixture
def case(world: World) -> Case:
    return load_case("4", world)


def count(path: Path, colour: str) -> int:
    """How many pixels are of a colour."""
    with Image.open(path) as opened:
        pixels = np.asarray(opened.convert("RGB"))
    rgb = list(bytes.fromhex(colour[1:]))
    return int((np.abs(pixels.astype(int) - rgb).max(-1) < 12).sum())


def draw(path: Path, case: Case, world: World, groups: Mapping[str, Sequence[Episode]]) -> Path:
    draw_trajectories(path, case, world, groups)
    return path


def test_each_group_has_a_line_and_a_place_in_the_legend(case: Case, world: World, tmp_path: Path) -> None:
    plans = {"a": (3,), "b": (0, 3), "c": (6, 3, 3)}
    groups = {name: [run_actions(case, world, plan)] for name, plan in plans.items()}
    together = draw(tmp_path / "together.png", case, world, groups)
    assert all(count(together, colour) > 300 for colour in (FIRST, SECOND, THIRD))
    alone = draw(tmp_path / "alone.png", case, world, {"a": groups["a"]})
    assert count(alone, FIRST) > 300 and not count(alone, THIRD)


def test_many_groups_have_a_panel_each(case: Case, world: World, tmp_path: Path) -> None:
    one = run_actions(case, world, (3, 4))
    few = draw(tmp_path / "few.png", case, world, {f"g{k}": [one] for k in range(MAX_TOGETHER)})
    many = draw(tmp_path / "many.png", case, world, {f"g{k}": [one] for k in range(MAX_TOGETHER + 3)})
    # All panels have the same colour: the place tells the groups apart.
    assert count(few, SECOND) > 100 and count(many, FIRST) > 900 and not count(many, SECOND)


def test_a_case_without_ships_and_a_name_that_is_no_formula(world: World, tmp_path: Path) -> None:
    case = load_case("1", world)
    groups = {"$a_b$": [run_actions(case, world, (3,))]}
    assert count(draw(tmp_path / "one.png", case, world, groups), FIRST) > 100
