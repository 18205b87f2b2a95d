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
from ship_trl.view.trajectories import draw_trajectories
from tests.view.episodes import run_actions

COLOUR = CHART_SERIES[0]


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


def test_each_group_has_a_panel(case: Case, world: World, tmp_path: Path) -> None:
    one = run_actions(case, world, (3, 4))
    alone = draw(tmp_path / "alone.png", case, world, {"a": [one]})
    many = draw(tmp_path / "many.png", case, world, {f"g{k}": [one] for k in range(6)})
    assert count(alone, COLOUR) > 300 and count(many, COLOUR) > 900


def test_a_case_without_ships_and_a_name_that_is_no_formula(world: World, tmp_path: Path) -> None:
    case = load_case("1", world)
    groups = {"$a_b$": [run_actions(case, world, (3,))]}
    assert count(draw(tmp_path / "one.png", case, world, groups), COLOUR) > 100
