"""Playing an episode; no screen; and real keys in a real window on a virtual screen."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pygame
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.config.errors import ConfigError
from ship_trl.sim.cases import load_case, load_world
from ship_trl.view.window.window import SPEEDS, Window, open_window
from tests.command import environment
from tests.view.episodes import view

PROGRAMS = ("Xvfb", "xdotool")
# A busy machine takes its time to start Python.
PATIENCE = 90.0


class StubWindow(Window):
    """A window with a given number of steps of one second."""

    status = ""
    steps = 0

    def __init__(self, steps: int, speed: float = 1.0) -> None:
        super().__init__(speed)
        self.steps = steps
        world = load_world()
        self.views = [view(load_case("1", world), world, (3,))]

    def tick(self, seconds: float) -> bool:
        return False


def state(player: StubWindow) -> tuple[float, bool]:
    return player.position, player.is_running


def test_it_runs_at_its_speed_and_stops_at_the_end() -> None:
    player = StubWindow(steps=10, speed=2.5)
    player.advance(1.0)
    assert state(player) == (2.5, True)
    # From between two steps, back is to the one that began last.
    player.step(-1)
    assert state(player) == (2.0, False)
    player.advance(100.0)
    player.step(1)
    assert state(player) == (3.0, False)
    player.pause()
    player.advance(100.0)
    assert state(player) == (10.0, False)
    player.pause()
    assert state(player) == (0.0, True)


def test_speed_has_levels() -> None:
    player = StubWindow(steps=3)
    player.change_speed(99)
    assert player.speed == SPEEDS[-1]
    player.change_speed(-99)
    assert player.speed == SPEEDS[0]


@given(st.lists(st.sampled_from(["pause", "step", "back", "restart", "wait", "seek"])))
def test_it_never_leaves_the_episode_and_pauses_on_whole_steps(keys: list[str]) -> None:
    player = StubWindow(steps=4)
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


def test_a_driver_that_was_asked_for_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window((640, 360)):
        assert pygame.display.get_window_size() == (640, 360)


@pytest.mark.parametrize(
    ("desktop", "opened"),
    [
        ((1280, 720), (1152, 648)),
        ((1366, 768), (1229, 691)),
        ((1600, 1200), (1440, 900)),
        ((2560, 1440), (1600, 900)),
    ],
)
def test_a_window_fits_the_screen(
    desktop: tuple[int, int], opened: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [desktop])
    with open_window((1600, 900)):
        assert pygame.display.get_window_size() == opened
        surface = pygame.display.get_surface()
        assert surface is not None and surface.get_flags() & pygame.RESIZABLE


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
