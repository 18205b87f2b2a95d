"""`python -m ship_trl play`: refusals, and its message where there is no screen."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import environment


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["target=nowhere"], "target: no case nowhere; allowed: 1, 2"),
        (["4"], "target: none given in 4; allowed: target=CASE"),
        (["--size", "10x10"], "--size: must be WIDTHxHEIGHT"),
        ([], "no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); python -m ship_trl evaluate"),
    ],
)
def test_wrong_input_is_refused_in_one_line(words: list[str], told: str, tmp_path: Path) -> None:
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    done = subprocess.run(
        [sys.executable, "-m", "ship_trl", "play", *words],
        cwd=tmp_path,
        env={key: value for key, value in environment().items() if key not in screens},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1 and done.stderr.startswith(f"ship_trl: {told}"), done.stderr
    assert len(done.stderr.splitlines()) == 1 and not list(tmp_path.iterdir())
