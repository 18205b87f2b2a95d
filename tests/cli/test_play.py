"""`python -m ship_trl play`: refusals, and its message where there is no screen."""

from pathlib import Path

import pytest

from tests.command import ship_trl

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
NO_SCREEN = "no screen (neither DISPLAY nor WAYLAND_DISPLAY is set)"
SITUATION = """{
    "ownShip": {"initial": {"position": {"lat": 58.0, "lon": 10.0}, "cog": 30, "sog": 12}},
    "targetShips": [{"initial": {"position": {"lat": 58.0146, "lon": 10.1031}, "cog": 300, "sog": 12}}]
}"""


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["target=nowhere"], "target: no case or suite nowhere; allowed: 1, 2"),
        (["4"], "4: unknown key; allowed here: target, situations.KEY"),
        ([], f"{NO_SCREEN}; python -m ship_trl evaluate"),
        (["target=imazu"], NO_SCREEN),
    ],
)
def test_wrong_input_is_refused_in_one_line(words: list[str], told: str, tmp_path: Path) -> None:
    first = f"import os\nfor name in {SCREENS}: os.environ.pop(name, None)"
    done = ship_trl(*words, folder=tmp_path, verb="play", code=1, first=first)
    assert done.stderr.startswith(f"ship_trl: {told}") and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_traffic_situation_can_be_played(tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text(SITUATION)
    first = f"import os\nfor name in {SCREENS}: os.environ.pop(name, None)"
    done = ship_trl("target=mine.json", folder=tmp_path, verb="play", code=1, first=first)
    assert done.stderr.startswith("ship_trl: mine.json: 1 scene, 0 refused; the first: 45 m are 0.30 NM")
    assert f"\nship_trl: {NO_SCREEN}; " in done.stderr
