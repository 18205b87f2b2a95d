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
        assert image.size == (1250, 800)
        pixels = np.asarray(image.convert("RGB"))[:, :650]
    heights = []
    for colour in ((0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00)):  # low, high
        rows = np.argwhere((pixels == colour).all(-1))[:, 0]
        heights.append(np.median(rows[rows > 400]))
    assert heights[0] > heights[1] + 50
