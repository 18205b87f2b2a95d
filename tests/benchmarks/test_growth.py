"""Slopes and bends are those of the sizes, and the picture has every part."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from benchmarks.growth import Line, draw, fastest, scenes, stepper


def test_slopes_and_the_bend_are_of_logarithms() -> None:
    line = Line("replay", "draw", (10, 100, 1000, 10_000), [1.0, 1.0, 10.0, 100.0])
    assert line.slopes == pytest.approx([0.0, 1.0, 1.0]) and line.bend == 100
    assert Line("replay", "draw", (1, 10), [1.0, 2.0]).bend is None


def test_the_fastest_round_counts_and_all_scenes_have_the_ships() -> None:
    calls: list[int] = []
    env = scenes(5, 3)
    step = stepper(env)
    assert env.reset()["state"].shape[0] == 3 and env.reset()["state"][:, 8].eq(5).all()
    found = fastest([step, lambda: calls.append(0)], 1)
    assert found[0] > found[1] > 0 and len(calls) > 1


def test_it_draws_every_part(tmp_path: Path) -> None:
    lines = [
        Line(part, "work", (1, 10), [1.0, 5.0]) for part in ("ships", "environments", "replay", "agents")
    ]
    draw(tmp_path / "growth.png", lines)
    with Image.open(tmp_path / "growth.png") as picture:
        assert picture.size == (1200, 900)
