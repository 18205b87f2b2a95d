"""Windows: real SDL events and the pictures that follow; no screen; real keys on a virtual screen."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pygame
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Perturbation
from ship_trl.policies.demonstrations import read_demonstrations
from ship_trl.policies.reference import best_known
from ship_trl.policies.registry import split_suites
from ship_trl.sim.cases import load_case, load_world
from ship_trl.view import pen
from ship_trl.view.dashboard import draw_dashboard
from ship_trl.view.window import Game, Session, Window, open_window
from tests.command import environment
from tests.view.episodes import entry, post, press, view

PROGRAMS = ("Xvfb", "xdotool")
# A busy machine takes its time to start Python.
PATIENCE = 90.0
SIZE = (1120, 630)
WORLD = load_world()
CASES = [load_case(name, WORLD) for name in ("2", "4")]


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])
    with open_window((1120, 630)):
        yield


@pytest.fixture
def session(window: None, tmp_path: Path) -> Session:
    policies = [entry("keep_course"), entry("random")]
    made = Session(policies, folder=tmp_path / "saved")
    made.pause()
    return made


@pytest.fixture
def game(window: None, tmp_path: Path) -> Game:
    made = Game(CASES, WORLD, tmp_path / "demos")
    made.speed = 1.0
    return made


class StubWindow(Window):
    """A window with four steps of one second."""

    status = ""
    steps = 4

    def __init__(self, speed: float = 1.0) -> None:
        super().__init__(speed)
        self.views = [view(load_case("1", WORLD), WORLD, (3,))]

    def tick(self, seconds: float) -> bool:
        return False


def test_it_runs_at_its_speed_and_stops_at_the_end() -> None:
    player = StubWindow(speed=2.5)
    for act, position, is_running in (
        (lambda: player.advance(1.0), 2.5, True),
        # From between two steps, back is to the one that began last.
        (lambda: player.step(-1), 2.0, False),
        (lambda: player.advance(100.0), 2.0, False),
        (lambda: player.step(1), 3.0, False),
        (player.pause, 3.0, True),
        (lambda: player.advance(100.0), 4.0, False),
        (player.pause, 0.0, True),
    ):
        act()
        assert (player.position, player.is_running) == (position, is_running)


@given(st.lists(st.sampled_from(["pause", "step", "back", "restart", "wait", "seek"])))
def test_it_never_leaves_the_episode_and_pauses_on_whole_steps(keys: list[str]) -> None:
    player = StubWindow()
    does = {
        "pause": player.pause,
        "step": lambda: player.step(1),
        "back": lambda: player.step(-1),
        "restart": player.restart,
        "wait": lambda: player.advance(0.13),
        "seek": lambda: player.seek(99),
    }
    for key in keys:
        does[key]()
        assert 0 <= player.position <= 4
        assert player.is_running or player.position == int(player.position)


def test_without_a_screen_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match="DISPLAY"), open_window((640, 360)):
        pass
    # One that is named and not there.
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(ConfigError), open_window((640, 360)):
        pass
    assert "SDL_VIDEODRIVER" not in os.environ


@pytest.mark.parametrize(
    ("desktop", "size", "opened"),
    [
        ((1366, 768), (1600, 900), (1229, 691)),
        ((1600, 1200), (1600, 900), (1440, 900)),
        ((2560, 1440), (1600, 900), (1600, 900)),
        # By default it fills the screen, whatever its shape.
        ((1024, 600), None, (921, 518)),
        ((3840, 2160), None, (3456, 1944)),
        ((3440, 1440), None, (2304, 1296)),
        ((1080, 1920), None, (972, 547)),
    ],
)
def test_a_window_fits_the_screen(
    desktop: tuple[int, int],
    size: tuple[int, int] | None,
    opened: tuple[int, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [desktop])
    with open_window(size):
        assert pygame.display.get_window_size() == opened
        surface = pygame.display.get_surface()
        assert surface is not None and surface.get_flags() & pygame.RESIZABLE


def read(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as opened:
        return np.asarray(opened).copy()


def test_pause_keeps_the_picture_and_steps_go_there_and_back(session: Session) -> None:
    first = press(session)
    session.tick(5.0)
    assert (press(session) == first).all()
    second = press(session, "right")
    assert (second != first).any() and session.position == 1
    assert (press(session, "right", "left") == second).all()
    assert (press(session, "left") == first).all()
    press(session, "up", "up", "down", "space")
    session.tick(0.31)
    assert session.position == pytest.approx(3.1)
    running = press(session)
    assert (running != first).any() and session.is_running
    # On, then to the end and back to the start by other ways: the same pixels.
    assert (press(session, "end") != running).any()
    assert (press(session, "r", "space", "down") == first).all()


def test_a_suite_is_shown_case_by_case_and_perturbed_starts_are_drawn_again(tmp_path: Path) -> None:
    one = entry("keep_course", "paper")
    entries = split_suites([replace(one, suite=replace(one.suite, perturbation=Perturbation(9.0)))])
    made = Session(entries, folder=tmp_path)
    assert [case.name for case in made.cases] == ["1", "2", "3", "4", "5", "6", "new"]
    (first,) = made.views
    made.next_episode()
    (again,) = made.views
    assert (first.telemetry.states[0] != again.telemetry.states[0]).any()
    assert first.case.name == again.case.name == "1"
    made.next_case()
    assert made.views[0].case.name == "2"


@pytest.mark.parametrize("size", [(120, 90), (300, 900), (1, 1)])
def test_a_window_may_be_made_very_small(session: Session, size: tuple[int, int]) -> None:
    pygame.display.set_mode(size, pygame.RESIZABLE)
    assert press(session, "right").shape == (size[1], size[0], 3)
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, {"pos": (0, 0), "button": 1}))
    press(session)


@pytest.mark.parametrize("key", ["a", "t", "s", "h"])
def test_a_look_is_taken_and_left_by_the_same_key(session: Session, key: str) -> None:
    before = press(session, *["right"] * 3)
    looked = press(session, key)
    assert (looked != before).any()
    assert (press(session, key) == before).all()


def test_policies_cases_and_episodes_come_in_turn(session: Session) -> None:
    def shown() -> tuple[str, str]:
        one = session.views[0]
        return one.title, one.case.name

    assert shown() == ("keep_course", "4")
    press(session, "p")
    assert shown() == ("random", "4")
    drawn_first = session.views[0].telemetry.actions.tolist()
    press(session, "e")
    assert shown() == ("random, episode 2", "4")
    assert session.views[0].telemetry.actions.tolist() != drawn_first
    press(session, "p", "c")
    title, case = shown()
    assert title == "keep_course, episode 2" and case != "4"
    seen = {case}
    for _ in range(len(session.cases) - 1):
        press(session, "c")
        seen.add(shown()[1])
    assert shown()[1] == "4" and seen >= {"1", "2", "3", "4", "5", "6", "new"}


def test_a_case_that_a_policy_cannot_run_is_reported_and_skipped(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = press(session)

    def refuse(*_: object) -> None:
        raise ConfigError("policy: it cannot")

    monkeypatch.setattr("ship_trl.view.window.view_entry", refuse)
    after = press(session, "c")
    assert session.status == "policy: it cannot" and session.case.name == "4"
    assert (after != before).any() and (press(session, "home", "space") == before).all()


def test_the_saved_picture_is_what_is_drawn_for_that_step(session: Session) -> None:
    press(session, *["right"] * 4, "i", "left", "i", "right", "h", "i")
    saved = sorted(session.folder.iterdir())
    assert [path.name for path in saved] == [
        "case4-keep_course-step03.png",
        "case4-keep_course-step04-2.png",
        "case4-keep_course-step04.png",
    ]
    third, again, fourth = (read(path) for path in saved)
    assert (fourth == again).all() and (third != fourth).any()
    expected = pen.new_surface(*SIZE)
    draw_dashboard(expected, session.views, 4, session.look)
    assert (pen.to_array(expected) == fourth).all()


def test_the_window_runs_until_it_is_told_to_stop(session: Session) -> None:
    post("m", "q")
    session.run()
    assert session.is_closed
    with Image.open(session.folder / "case4-keep_course-film.gif") as film:
        assert film.size == SIZE and getattr(film, "n_frames", 0) > 20
    session.is_closed = False
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    session.run()
    assert session.is_closed


def test_a_click_in_a_graph_goes_there(session: Session) -> None:
    press(session)
    at = {"pos": (SIZE[0] // 4, SIZE[1] - 50), "button": 1}
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, at))
    press(session)
    assert 3 < session.position < session.steps - 3


def test_two_policies_go_in_step() -> None:
    pair = Session([entry("keep_course"), entry("random")], compare=True)
    assert [view.title for view in pair.views] == ["keep_course", "random"]
    steps = [view.telemetry.steps for view in pair.views]
    assert pair.steps == max(steps)
    with pytest.raises(ConfigError, match="--compare: needs two policies, got keep_course alone"):
        Session([entry("keep_course")], compare=True)


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
    assert game.telemetry.outcome == "goal"
    (kept,) = read_demonstrations(tmp_path / "demos", CASES[0], WORLD)
    assert kept.actions == plan.actions == game.actions
    assert kept.episode_return == pytest.approx(plan.episode_return, abs=1e-3)
    assert game.status.startswith("goal: 83.9 of 83.9, kept as 2-001.json")
    # Nothing is kept twice.
    to_the_end(game)
    assert len(game.kept) == 1
    press(game, "space")
    assert game.actions == [] and game.is_running


@pytest.fixture
def screen() -> Iterator[str]:
    """A virtual screen of its own."""
    read, write = os.pipe()
    options = ["-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    line = ["Xvfb", "-displayfd", str(write), *options]
    server = subprocess.Popen(line, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            yield f":{number.readline().strip()}"
    finally:
        server.terminate()
        server.wait()


@pytest.mark.long  # it starts a server of the screen
@pytest.mark.skipif(not all(map(shutil.which, PROGRAMS)), reason=f"needs {' and '.join(PROGRAMS)}")
def test_real_keys_in_a_real_window(screen: str, tmp_path: Path) -> None:
    there = environment() | {"DISPLAY": screen}
    there.pop("SDL_VIDEODRIVER", None)
    line = [sys.executable, "-m", "ship_trl", "watch", "keep_course", "target=4", "--size", "960x540"]
    with (tmp_path / "said").open("w") as said:
        watching = subprocess.Popen(line, cwd=tmp_path, env=there, stdout=said, stderr=said)
    saved, end = tmp_path / "outputs" / "watch", time.monotonic() + PATIENCE

    def press(*keys: str) -> None:
        subprocess.run(["xdotool", "key", "--delay", "100", *keys], env=there, check=True)

    def press_until(pattern: str, *keys: str) -> None:
        """Press keys until a picture of this name is saved: before the window is open they are lost."""
        while not list(saved.glob(pattern)) and watching.poll() is None and time.monotonic() < end:
            press(*keys)
            time.sleep(0.5)

    try:
        press_until("*-step19.png", "End", "i")
        press_until("*-step18.png", "End", "Left", "i")
        last, before = (next(saved.glob(f"*-step{step}.png")) for step in (19, 18))
        assert last.read_bytes() != before.read_bytes()
        press("q")
        assert watching.wait(PATIENCE) == 0
    finally:
        watching.kill()
        watching.wait()
    assert (tmp_path / "said").read_text() == ""
