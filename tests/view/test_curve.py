"""The learning curve: its mean, its file, its lines."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from ship_trl.view.curve import draw_curve


@dataclass(frozen=True)
class Row:
    episode: int
    episode_return: float
    outcome: str
    epsilon: float


ROWS = [Row(k, 3.0 * k - 300, ("collision", "timeout", "goal")[k % 3], 1 - k / 100) for k in range(1, 101)]
GREEDY = [(0, -320.0, "collision"), (50, -500.0, "timeout"), (100, 60.0, "goal")]


def test_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "curve.png"
    draw_curve(path, ROWS, GREEDY, 63.7, "case 3 -> case 4, FT3, seed 0")
    assert [p.name for p in tmp_path.iterdir()] == ["curve.png"]
    with Image.open(path) as image:
        assert image.size == (1200, 800)
        pixels = np.asarray(image.convert("RGB"))
    assert path.stat().st_size > 20_000
    # The blue of the moving mean rises from left to right.
    blue = np.argwhere((pixels == (0x00, 0x72, 0xB2)).all(-1))
    blue = blue[blue[:, 1] < 850]
    left, right = (
        blue[blue[:, 1] < np.quantile(blue[:, 1], 0.2)],
        blue[blue[:, 1] > np.quantile(blue[:, 1], 0.8)],
    )
    assert left[:, 0].mean() > right[:, 0].mean() + 100


@pytest.mark.parametrize(
    ("rows", "greedy"), [([], [GREEDY[0]]), (ROWS[:2], GREEDY[:1])], ids=["no episode", "two episodes"]
)
def test_hardly_anything_to_show(
    tmp_path: Path, rows: list[Row], greedy: list[tuple[int, float, str]]
) -> None:
    draw_curve(tmp_path / "curve.png", rows, greedy, 83.9, "case 1, scratch, seed 0")
    with Image.open(tmp_path / "curve.png") as image:
        image.verify()


def test_a_title_is_not_a_formula(tmp_path: Path) -> None:
    draw_curve(tmp_path / "curve.png", ROWS, GREEDY, 63.7, "case $mine{$_1, scratch, seed 0")


def test_a_failed_drawing_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fill_the_disk(figure: Figure, path: Path) -> None:
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fill_the_disk)
    path = tmp_path / "curve.png"
    path.write_bytes(b"old")
    with pytest.raises(OSError, match="disk full"):
        draw_curve(path, ROWS, GREEDY, 63.7, "case 3, scratch, seed 0")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["curve.png"]
