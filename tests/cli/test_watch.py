"""`python -m ship_trl watch`: its words, and what it says where there is no screen."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ship_trl.cli.watch import main
from tests.command import ROOT, environment


def refused(capsys: pytest.CaptureFixture[str], command: Callable[[list[str]], None], *words: str) -> str:
    with pytest.raises(SystemExit) as left:
        command(list(words))
    assert left.value.code == 1
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1 and told.startswith("ship_trl: ")
    return told


def test_without_a_screen_record_is_offered(tmp_path: Path) -> None:
    there = environment()
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        there.pop(name, None)
    line = [sys.executable, "-m", "ship_trl", "watch", "keep_course", "random", "--compare", "target=2"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, env=there)
    assert done.returncode == 1 and done.stdout == ""
    (said,) = done.stderr.splitlines()
    assert said.startswith("ship_trl: no screen")
    assert "python -m ship_trl record keep_course random target=2 --compare --output" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("random", "target: none given for random"),
        ("nobody target=2", "policy: no nobody; allowed"),
        ("random target=99", "target: no case 99"),
        ("random --compare target=2", "--compare: needs two policies, got random alone"),
        ("random target=2 --size 5x5", "--size: must be WIDTHxHEIGHT"),
        ("random target=2 --size large", "--size: must be WIDTHxHEIGHT"),
        ("random target=2 --seed -1", "--seed: must be at least 0, got -1"),
        ("random target=2 --fast", "unrecognized arguments: --fast"),
        ("none.safetensors target=2", "policy: no file none.safetensors"),
    ],
)
def test_what_is_wrong_is_said(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert said in refused(capsys, main, *words.split())


@pytest.mark.parametrize("module", ["watch", "record"])
def test_help_knows_no_torch(module: str) -> None:
    line = [sys.executable, "-X", "importtime", "-m", "ship_trl", module, "--help"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=ROOT, check=True)
    assert "target=CASE" in done.stdout
    assert " torch\n" not in done.stderr and " pygame\n" not in done.stderr
