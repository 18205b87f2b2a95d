"""`python -m ship_trl play`: refusals, and its message where there is no screen."""

from pathlib import Path

import pytest

from tests.command import ship_trl

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["target=nowhere"], "target: no case nowhere; allowed: 1, 2"),
        (["4"], "target: must be given as target=CASE, got 4"),
        ([], "no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); python -m ship_trl evaluate"),
    ],
)
def test_wrong_input_is_refused_in_one_line(words: list[str], told: str, tmp_path: Path) -> None:
    first = f"import os\nfor name in {SCREENS}: os.environ.pop(name, None)"
    done = ship_trl(*words, folder=tmp_path, verb="play", code=1, first=first)
    assert done.stderr.startswith(f"ship_trl: {told}") and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
