"""Steering a ship: real SDL events, the steps of the world, and kept episodes."""

from pathlib import Path

import pytest

from ship_trl.policies.demonstrations import read_demonstrations
from ship_trl.policies.reference import best_known, follow_plan
from ship_trl.sim.cases import load_case, load_world
from ship_trl.view.window.game import Game
from tests.view.episodes import press

pytestmark = pytest.mark.usefixtures("window")
WORLD = load_world()
CASES = [load_case(name, WORLD) for name in ("2", "4")]


@pytest.fixture
def game(tmp_path: Path) -> Game:
    return Game(CASES, WORLD, tmp_path / "demos", speed=1.0)


def to_the_end(game: Game) -> None:
    for _ in range(2 * WORLD.max_steps):
        game.tick(1.0)


def test_the_ship_waits_until_the_space_key(game: Game) -> None:
    first = press(game)
    game.tick(10.0)
    assert (press(game) == first).all() and game.actions == []
    press(game, "space")
    game.tick(0.5)
    assert (press(game) != first).any() and game.actions == [3]
    press(game, "space")
    game.tick(10.0)
    assert game.actions == [3]


def test_the_rudder_goes_by_keys_and_stays(game: Game) -> None:
    for keys, rudder in (
        ("right " * 2, 5),
        ("right " * 3, 6),
        ("up", 3),
        ("left " * 9, 0),
        ("5", 4),
        ("9", 4),
    ):
        press(game, *keys.split())
        assert game.rudder == rudder
    press(game, "space")
    for _ in range(3):
        game.tick(1.0)
    assert game.actions == [4, 4, 4]


def test_a_finished_game_follows_the_world_and_is_kept(game: Game, tmp_path: Path) -> None:
    plan = best_known(CASES[0], WORLD)
    press(game, "space")
    for action in plan.actions:
        press(game, str(action + 1))
        game.tick(1.0)
    game.tick(1.0)
    assert game.is_over and game.telemetry.outcome == "goal"
    (kept,) = read_demonstrations(tmp_path / "demos", CASES[0], WORLD)
    assert kept.actions == plan.actions == game.actions
    assert kept.episode_return == pytest.approx(plan.episode_return, abs=1e-3)
    assert follow_plan(CASES[0], WORLD, kept.actions).episode_return == pytest.approx(
        kept.episode_return, abs=1e-3
    )
    assert game.status.startswith("goal: 83.9 of 83.9, kept as 2-001.json")
    # Nothing is kept twice.
    to_the_end(game)
    assert len(game.kept) == 1
    press(game, "space")
    assert game.actions == [] and game.is_running


def test_a_collision_is_an_end_too(game: Game) -> None:
    press(game, "c", "space")
    assert game.case.name == "4"
    to_the_end(game)
    assert game.telemetry.outcome == "collision" and "collision: " in game.status
    assert [path.name for path in game.kept] == ["4-001.json"]


def test_beginning_again_keeps_nothing(game: Game) -> None:
    first = press(game)
    press(game, "space")
    game.tick(1.0)
    assert (press(game, "r") == first).all() and game.kept == []


@pytest.mark.parametrize("folder", ["demos", None])
def test_a_folder_that_cannot_be_written_is_said(folder: str | None, tmp_path: Path) -> None:
    (tmp_path / "demos").write_text("")
    game = Game(CASES, WORLD, tmp_path / folder if folder else None, speed=1.0)
    press(game, "space")
    to_the_end(game)
    assert game.is_over and game.kept == []
    assert ("not kept: " in game.status) == bool(folder)


def test_help_and_quitting(game: Game) -> None:
    before = press(game)
    assert (press(game, "h") != before).any()
    assert (press(game, "escape") == before).all() and not game.is_closed
    press(game, "escape")
    assert game.is_closed
