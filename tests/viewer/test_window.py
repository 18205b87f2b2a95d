"""A window where there is no screen, and a real one on a virtual screen with real keys."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ship_trl.viewer.window import NoScreenError, open_window
from tests.command import environment

PROGRAMS = ("Xvfb", "xdotool")
# A busy machine takes its time to start Python.
PATIENCE = 90.0


def test_without_a_screen_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(NoScreenError, match="DISPLAY"), open_window((640, 360), "test"):
        pass
    # One that is named and not there.
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(NoScreenError), open_window((640, 360), "test"):
        pass
    assert "SDL_VIDEODRIVER" not in os.environ


def test_a_driver_that_was_asked_for_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window((640, 360), "test") as window:
        assert window.surface.get_size() == (640, 360) and not window.held("left")


@pytest.fixture
def screen() -> Iterator[str]:
    """A virtual screen of its own."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
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
    piped: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    watching = subprocess.Popen(line, cwd=tmp_path, env=there, **piped)
    saved = tmp_path / "outputs" / "watch"
    names: list[str] = []

    def keys(*pressed: str) -> None:
        subprocess.run(["xdotool", "key", "--delay", "100", *pressed], env=there, check=True)

    def new(seconds: float) -> list[str]:
        """Wait for pictures that were not there."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and watching.poll() is None:
            found = sorted(p.name for p in saved.glob("case4*.png") if p.name not in names)
            if found:
                names.extend(found)
                return found
            time.sleep(0.05)
        return []

    def picture(*before: str) -> bytes:
        """Press keys, save the picture, and return its bytes once it is there, and no other comes."""
        keys(*before, "i")
        found = new(PATIENCE)
        while more := new(0.7):
            found = more
        return (saved / found[-1]).read_bytes()

    try:
        # The window is open when a key has done something; what else was pressed meanwhile comes too.
        end = time.monotonic() + PATIENCE
        while not names and time.monotonic() < end:
            keys("End", "i")
            new(0.5)
        while new(1.5):
            pass
        # On a busy machine a key may count twice: the end is the end however often it is asked for.
        at_end, before, there_again = (picture(*pressed) for pressed in (("End",), ("Left",), ("End",)))
        assert at_end == there_again != before
        keys("q")
        assert watching.wait(PATIENCE) == 0
    finally:
        watching.kill()
        out, told = watching.communicate()
    assert (out, told) == ("", "")
