"""The map of failures: colours stand where the target ship starts."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from ship_trl.view.polar import COLOURS, draw_failures


@pytest.mark.parametrize(("bearing", "x", "y"), [(0, 0, -1), (90, 1, 0), (225, -0.7, 0.7)])
def test_a_cell_that_fails_is_dark(bearing: int, x: float, y: float, tmp_path: Path) -> None:
    scenes = pd.DataFrame(
        [
            ("0.5 to 1", angle, away, angle == bearing and away == 450)
            for angle in range(0, 360, 15)
            for away in range(50, 650, 100)
        ],
        columns=["speed", "bearing", "range", "failed"],
    )
    draw_failures(tmp_path / "map.png", {"mine: fails in 1%": scenes}, 15, 100)
    with Image.open(tmp_path / "map.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)

    def middle(colour: str, rows: slice = slice(0, 480)) -> tuple[float, float, int]:
        off = np.abs(pixels[rows] - 255 * np.array(to_rgb(colour))).max(-1)
        down, across = (off < 3).nonzero()
        return float(across.mean()), float(down.mean()), len(down)

    (left, top, count), (centre_x, centre_y, others) = middle(COLOURS[-1]), middle(COLOURS[0])
    away = np.array([left - centre_x, top - centre_y])
    assert 0 < count < others / 20
    assert away / np.linalg.norm(away) == pytest.approx(np.array([x, y]), abs=0.15)
