"""The lessons read as lessons, and run from the first cell to the last, on less data."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.command import ROOT
from tests.forked import run_script

LESSONS = sorted((ROOT / "examples/lessons").glob("*.py"))
# What a test makes smaller in each, what it leaves in outputs/lessons, and what it prints.
SMALLER = {
    "1_ships": {'SUITE = "imazu"': 'SUITE = "paper"', "target=imazu18": "target=2"},
    "2_transfer": {"EPISODES = 200": "EPISODES = 3"},
    "3_own_encounter": {
        "EPISODES = 100": "EPISODES = 2",
        '"--compare", ': '"--compare", "--size", "640x360", ',
    },
}
LEFT = {
    "1_ships": ("map.png", "pixels.png", "imazu18.gif"),
    "2_transfer": ("curves.png", "transfer/low/FT3/seed=0/policy.safetensors"),
    "3_own_encounter": ("ferry.png", "ferry.gif", "ferry_paths.png"),
}
PRINTED = {
    "1_ships": r"Discrete\(7\), observation \(84, 84, 1\), uint8\n.*goal True, least distance \d+ m\n",
    "2_transfer": r"FT3: greedy area -?[\d.]+; best return -?[\d.]+ \(\w+\)",
    "3_own_encounter": r"sb_mpc .*goal",
}
CELL = re.compile(r"^# %%(?: \[markdown\])?$", re.MULTILINE)


@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_a_lesson_has_a_title_sections_and_its_pictures(path: Path) -> None:
    head, first, *_ = CELL.split(path.read_text())
    text = "\n".join(
        line.removeprefix("# ") for line in path.read_text().splitlines() if line.startswith("# ")
    )
    assert head == "" and first.startswith("\n# # "), "it begins with its title"
    assert len(re.findall(r"^# .+", text, re.MULTILINE)) == 1
    assert len(re.findall(r"^## .+", text, re.MULTILINE)) >= 3
    pictures = re.findall(r"!\[[^]]+\]\((pictures/[^)]+)\)", text)
    assert all((path.parent / one).is_file() for one in pictures)


def test_a_lesson_shows_every_picture() -> None:
    text = "".join(path.read_text() for path in LESSONS)
    assert all(f"(pictures/{path.name})" in text for path in (ROOT / "examples/lessons/pictures").iterdir())


@pytest.mark.long
@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_a_lesson_runs(path: Path, tmp_path: Path) -> None:
    text = path.read_text()
    for large, small in SMALLER[path.stem].items():
        assert text.count(large) == 1, large
        text = text.replace(large, small)
    (tmp_path / path.name).write_text(text)
    ended = run_script(tmp_path / path.name, folder=tmp_path)
    assert ended.code == 0, ended
    assert re.search(PRINTED[path.stem], ended.out), ended.out
    for name in LEFT[path.stem]:
        left = tmp_path / "outputs/lessons" / name
        assert left.stat().st_size > 1000, name
        if left.suffix in (".png", ".gif"):
            with Image.open(left) as picture:
                assert np.asarray(picture.convert("L")).std() > 0
