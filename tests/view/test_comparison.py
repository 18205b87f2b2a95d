"""Learning curves beside each other."""

from pathlib import Path

import numpy as np
from PIL import Image
from ship_trl.view.comparison import Curve, draw_comparison


def curve(level: float, episodes: int = 60) -> Curve:
    return Curve(np.full(episodes, level), np.arange(0, episodes + 1, 10), np.full(7, level))


def test_every_group_has_its_line_at_its_height(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    groups = {"low": [curve(0.0), curve(10.0), curve(5.0)], "high": [curve(50.0), curve(50.0, 55)]}
    draw_comparison(path, {"case 4": groups, "case 2": groups}, {"case 4": 60.0, "case 2": 60.0})
    assert [p.name for p in tmp_path.iterdir()] == ["curves.png"]
    with Image.open(path) as image:
        assert image.size == (1040, 640)
        pixels = np.asarray(image.convert("RGB"))[:560, :520]  # of the first panel, without its legend
    heights = []
    for colour in ((0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00)):  # low, high
        rows = np.argwhere((pixels == colour).all(-1))[:, 0]
        heights.append(np.median(rows[rows > 300]))
    assert heights[0] > heights[1] + 50


def test_many_panels_fit_on_a_screen(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    names = [f"case {k}" for k in range(8)]
    groups = {f"arm {k}": [curve(float(k))] for k in range(10)}
    draw_comparison(path, dict.fromkeys(names, groups), dict.fromkeys(names, 60.0))
    with Image.open(path) as image:
        assert image.width <= 1600 and image.height <= 2000
        pixels = np.asarray(image.convert("RGB"))
    # Three rows of three, and the ninth place is empty.
    third, high = pixels.shape[1] // 3, pixels.shape[0] // 3
    inked = [
        [bool((pixels[r * high :, c * third :][:high, :third] < 128).any()) for c in range(3)]
        for r in range(3)
    ]
    assert inked == [[True] * 3, [True] * 3, [True, True, False]]


def test_the_legend_covers_no_line(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    falling = Curve(np.linspace(60, -300, 60), np.arange(0, 61, 10), np.linspace(60, -90, 7))
    draw_comparison(path, {"case 4": {"falling": [falling]}}, {"case 4": 60.0})
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    line = (pixels == (0x00, 0x72, 0xB2)).all(-1)
    # In both halves it goes on to the right end of the axes without a gap.
    for half in (line[:300], line[300:570]):
        columns = np.flatnonzero(half.any(0))
        assert columns[0] < 130 and columns[-1] > 490 and np.diff(columns).max() <= 3
