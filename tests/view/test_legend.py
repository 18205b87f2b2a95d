"""The strip below a picture: its scale bar is to scale, and it names every colour."""

import numpy as np
import pytest

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view.legend import BAR, HEIGHT, draw_legend
from ship_trl.view.lettering import INK


@pytest.mark.parametrize("side", [252, 420, 600])
def test_the_bar_is_as_long_as_it_says(world: World, side: int) -> None:
    strip = np.asarray(draw_legend(900, side, world))
    row = (strip[HEIGHT // 2] == INK).all(-1).nonzero()[0]
    # The first run of ink is the bar.
    gaps = (np.diff(row) > 1).nonzero()[0]
    length = row[gaps[0] if len(gaps) else -1] - row[0]
    assert abs(length - BAR * side / (2 * scene.WINDOW)) <= 1


def test_every_colour_of_the_scene_is_there(world: World) -> None:
    colours = {tuple(pixel) for pixel in np.asarray(draw_legend(900, 420, world)).reshape(-1, 3).tolist()}
    assert {scene.OWN, scene.TARGET, scene.GOAL_CIRCLE, scene.SAFE_CIRCLE, scene.LINE} <= colours


def test_it_says_the_distances_of_the_world(world: World) -> None:
    before = np.asarray(draw_legend(900, 420, world))
    world.safe_distance = 50.0
    assert (np.asarray(draw_legend(900, 420, world)) != before).any()
