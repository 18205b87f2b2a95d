"""A person at the helm: real events of SDL's, the world's own steps, episodes that are kept."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray

from ship_trl.policies.demonstrations import read_demonstrations
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.reference import best_known, follow_plan
from ship_trl.view.draw import to_array
from ship_trl.viewer.game import Game
from ship_trl.viewer.window import Window, open_window

WORLD = load_world()
CASES = [load_case(name, WORLD) for name in ("2", "4")]


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window((1120, 630), "test") as opened:
        yield opened


@pytest.fixture
def game(tmp_path: Path) -> Game:
    return Game(CASES, WORLD, tmp_path / "demos", speed=1.0)


def press(window: Window, game: Game, *keys: str) -> NDArray[np.uint8]:
    """Put keys into the queue, let the game take them out, and return what the window shows."""
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))
    for found in window.presses():
        game.press(found, window.surface)
    game.draw(window.surface)
    window.present()
    return to_array(window.surface)


def to_the_end(game: Game) -> None:
    for _ in range(2 * WORLD.max_steps):
        game.tick(1.0)


def test_the_ship_waits_until_it_is_told_to_sail(window: Window, game: Game) -> None:
    first = press(window, game)
    game.tick(10.0)
    assert (press(window, game) == first).all() and game.helm.actions == []
    press(window, game, "space")
    game.tick(0.5)
    assert (press(window, game) != first).any() and game.helm.actions == [3]
    press(window, game, "space")
    game.tick(10.0)
    assert game.helm.actions == [3]


def test_the_rudder_goes_by_keys_and_stays(window: Window, game: Game) -> None:
    press(window, game, "right", "right")
    assert game.helm.rudder == 5
    press(window, game, "right", "right", "right")
    assert game.helm.rudder == 6
    press(window, game, "up")
    assert game.helm.rudder == 3
    press(window, game, *["left"] * 9)
    assert game.helm.rudder == 0
    press(window, game, "5")
    assert game.helm.rudder == 4
    press(window, game, "9")
    assert game.helm.rudder == 4
    press(window, game, "space")
    for _ in range(3):
        game.tick(1.0)
    assert game.helm.actions == [4, 4, 4]


def test_what_is_sailed_is_the_world_and_is_kept(window: Window, game: Game, tmp_path: Path) -> None:
    plan = best_known(CASES[0], WORLD)
    press(window, game, "space")
    for action in plan.actions:
        press(window, game, str(action + 1))
        game.tick(1.0)
    game.tick(1.0)
    assert game.helm.over and game.helm.telemetry.outcome == "goal"
    (kept,) = read_demonstrations(tmp_path / "demos", CASES[0], WORLD)
    assert kept.actions == plan.actions == game.helm.actions
    assert kept.episode_return == pytest.approx(plan.episode_return, abs=1e-3)
    assert follow_plan(CASES[0], WORLD, kept.actions).episode_return == pytest.approx(
        kept.episode_return, abs=1e-3
    )
    assert game.status.startswith("goal: 83.9 of 83.9, kept as 2-001.json")
    # Nothing is kept twice.
    to_the_end(game)
    assert len(game.kept) == 1
    press(window, game, "space")
    assert game.helm.actions == [] and game.player.running


def test_a_collision_is_an_end_too(window: Window, game: Game) -> None:
    press(window, game, "c", "space")
    assert game.helm.case.name == "4"
    to_the_end(game)
    assert game.helm.telemetry.outcome == "collision" and "collision: " in game.status
    assert [path.name for path in game.kept] == ["4-001.json"]


def test_beginning_again_keeps_nothing(window: Window, game: Game) -> None:
    first = press(window, game)
    press(window, game, "space")
    game.tick(1.0)
    assert (press(window, game, "r") == first).all() and game.kept == []


def test_without_a_folder_nothing_is_kept(window: Window, tmp_path: Path) -> None:
    game = Game(CASES, WORLD, None, speed=1.0)
    press(window, game, "space")
    to_the_end(game)
    assert game.helm.over and game.kept == [] and "kept" not in game.status


def test_a_folder_that_cannot_be_written_is_said(window: Window, game: Game, tmp_path: Path) -> None:
    (tmp_path / "demos").write_text("")
    press(window, game, "space")
    to_the_end(game)
    assert "not kept: " in game.status and game.kept == []


def test_help_and_quitting(window: Window, game: Game) -> None:
    before = press(window, game)
    assert (press(window, game, "h") != before).any()
    assert (press(window, game, "escape") == before).all() and not game.closed
    press(window, game, "escape")
    assert game.closed
