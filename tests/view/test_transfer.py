"""The picture of a transfer beside learning from scratch."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from ship_trl.view.curve import MEAN
from ship_trl.view.transfer import SCRATCH, draw_transfer


def colours(path: Path) -> set[tuple[int, ...]]:
    with Image.open(path) as drawn:
        assert drawn.size == (1200, 750)
        return {tuple(pixel) for pixel in np.asarray(drawn.convert("RGB")).reshape(-1, 3).tolist()}


def rgb(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(colour[1:]))


@pytest.mark.parametrize("seeds", [1, 5])
def test_both_lines_are_drawn(tmp_path: Path, seeds: int) -> None:
    path = tmp_path / "transfer.png"
    scratch = np.linspace(-300, 50, 100) + np.zeros((seeds, 1)) + np.arange(seeds)[:, None]
    draw_transfer(path, "FT3", list(np.linspace(-200, 80, 120)), scratch, 83.9, "case $1 -> case 2_")
    assert {rgb(MEAN), rgb(SCRATCH)} <= colours(path)


def test_other_returns_give_another_picture(tmp_path: Path) -> None:
    for name, worse in (("a", 0.0), ("b", 40.0)):
        scratch = np.full((2, 50), -100.0 - worse)
        draw_transfer(tmp_path / f"{name}.png", "FT3", [0.0] * 50, scratch, 83.9, "title")
    assert (tmp_path / "a.png").read_bytes() != (tmp_path / "b.png").read_bytes()
