"""`python -m ship_trl play`: refusals, and its message where there is no screen."""

from pathlib import Path

import pytest

from ship_trl.cli.play import main
from tests.command import refused


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["target=nowhere"], "target: no case nowhere; allowed: 1, 2"),
        (["4"], "target: none given in 4; allowed: target=CASE"),
        (["--size", "10x10"], "--size: must be WIDTHxHEIGHT"),
        ([], "no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); python -m ship_trl evaluate"),
    ],
)
def test_wrong_input_is_refused_in_one_line(
    words: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    assert refused(capsys, main, *words).startswith(f"ship_trl: {told}")
    assert not list(tmp_path.iterdir())
