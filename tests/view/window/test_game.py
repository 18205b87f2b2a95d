"""A person at the helm: real events of SDL's, the world's own steps, episodes that are kept."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ship_trl.policies.demonstrations import read_demonstrations
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.reference import best_known, sail
from ship_trl.view import pen
from ship_trl.view.window.display import open_window
from ship_trl.view.window.game import Game
from tests.view.episodes import post

SIZE = (1120, 630)
WORLD = load_world()
CASES = [load_case(name, WORLD) for name in ("2", "4")]


@pytest.fixture(autouse=True)
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window(SIZE, "test"):
        yield


@pytest.fixture
def game(tmp_path: Path) -> Game:
    return Game(CASES, WORLD, tmp_path / "demos", speed=1.0)


def press(game: Game, *keys: str) -> NDArray[np.uint8]:
    """Press keys in the window, and return what it shows then."""
    post(*keys)
    game.handle_events()
    return pen.to_array(game.show())


def to_the_end(game: Game) -> None:
    for _ in range(2 * WORLD.max_steps):
        game.tick(1.0)


def test_the_ship_waits_until_it_is_told_to_sail(game: Game) -> None:
    first = press(game)
    game.tick(10.0)
    assert (press(game) == first).all() and game.helm.actions == []
    press(game, "space")
    game.tick(0.5)
    assert (press(game) != first).any() and game.helm.actions == [3]
    press(game, "space")
    game.tick(10.0)
    assert game.helm.actions == [3]


def test_the_rudder_goes_by_keys_and_stays(game: Game) -> None:
    press(game, "right", "right")
    assert game.helm.rudder == 5
    press(game, "right", "right", "right")
    assert game.helm.rudder == 6
    press(game, "up")
    assert game.helm.rudder == 3
    press(game, *["left"] * 9)
    assert game.helm.rudder == 0
    press(game, "5")
    assert game.helm.rudder == 4
    press(game, "9")
    assert game.helm.rudder == 4
    press(game, "space")
    for _ in range(3):
        game.tick(1.0)
    assert game.helm.actions == [4, 4, 4]


def test_what_is_sailed_is_the_world_and_is_kept(game: Game, tmp_path: Path) -> None:
    plan = best_known(CASES[0], WORLD)
    press(game, "space")
    for action in plan.actions:
        press(game, str(action + 1))
        game.tick(1.0)
    game.tick(1.0)
    assert game.helm.is_over and game.helm.telemetry.outcome == "goal"
    (kept,) = read_demonstrations(tmp_path / "demos", CASES[0], WORLD)
    assert kept.actions == plan.actions == game.helm.actions
    assert kept.episode_return == pytest.approx(plan.episode_return, abs=1e-3)
    assert sail(CASES[0], WORLD, kept.actions).episode_return == pytest.approx(kept.episode_return, abs=1e-3)
    assert game.status.startswith("goal: 83.9 of 83.9, kept as 2-001.json")
    # Nothing is kept twice.
    to_the_end(game)
    assert len(game.kept) == 1
    press(game, "space")
    assert game.helm.actions == [] and game.player.running


def test_a_collision_is_an_end_too(game: Game) -> None:
    press(game, "c", "space")
    assert game.helm.case.name == "4"
    to_the_end(game)
    assert game.helm.telemetry.outcome == "collision" and "collision: " in game.status
    assert [path.name for path in game.kept] == ["4-001.json"]


def test_beginning_again_keeps_nothing(game: Game) -> None:
    first = press(game)
    press(game, "space")
    game.tick(1.0)
    assert (press(game, "r") == first).all() and game.kept == []


def test_without_a_folder_nothing_is_kept(tmp_path: Path) -> None:
    game = Game(CASES, WORLD, None, speed=1.0)
    press(game, "space")
    to_the_end(game)
    assert game.helm.is_over and game.kept == [] and "kept" not in game.status


def test_a_folder_that_cannot_be_written_is_said(game: Game, tmp_path: Path) -> None:
    (tmp_path / "demos").write_text("")
    press(game, "space")
    to_the_end(game)
    assert "not kept: " in game.status and game.kept == []


def test_help_and_quitting(game: Game) -> None:
    before = press(game)
    assert (press(game, "h") != before).any()
    assert (press(game, "escape") == before).all() and not game.is_closed
    press(game, "escape")
    assert game.is_closed
