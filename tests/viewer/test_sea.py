"""The game picture in both frames."""

from itertools import pairwise

import numpy as np
import pygame
import pytest
import torch
from numpy.typing import NDArray
from PIL import Image

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import load_case
from ship_trl.sim.render import Rasteriser
from ship_trl.view.draw import to_array
from ship_trl.viewer.sea import absolute_frame, draw_sea, relative_frame
from ship_trl.viewer.telemetry import Telemetry, of_episode
from tests.view.sailing import sail

SIDE = 840


def sailed(world: World, case: str = "4", plan: tuple[int, ...] = (3, 4)) -> Telemetry:
    chosen = load_case(case, world)
    return of_episode(chosen, world, sail(chosen, world, plan))


def picture(
    numbers: Telemetry, position: float, absolute: bool = False, to_scale: bool = False
) -> NDArray[np.uint8]:
    surface = pygame.Surface((SIDE, SIDE), depth=32)
    frame = absolute_frame((numbers,), SIDE) if absolute else None
    draw_sea(surface, numbers, position, frame, to_scale)
    return to_array(surface)


def count(pixels: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((pixels == colour).all(-1).sum())


def test_the_relative_picture_is_the_networks_made_large(world: World) -> None:
    numbers = sailed(world)
    state = torch.from_numpy(numbers.states[0]).float()
    seen = Rasteriser(numbers.case, world, colour=True)(state).numpy()
    large = Image.fromarray(picture(numbers, 0))
    small = np.asarray(large.resize((scene.SIZE, scene.SIZE), Image.Resampling.BOX)).astype(int)
    apart = np.abs(small - np.moveaxis(seen, 0, -1)).max(-1)
    # Letters, scale, arrow and the thinner line are for people.
    assert (apart > 40).mean() < 0.06
    ship = np.moveaxis(seen, 0, -1)
    green = (ship[..., 1].astype(int) - ship[..., 0]) > 120
    assert green.sum() > 20 and (apart[green] < 90).all()


def test_own_ship_stays_in_the_middle_of_one_frame_and_moves_in_the_other(world: World) -> None:
    numbers = sailed(world)
    for position in (0.0, 3.5, 9.0):
        own = numbers.between(position)[0]
        assert relative_frame(own, SIDE).point(own[0], own[1]) == pytest.approx((SIDE / 2, SIDE / 2))
        assert tuple(picture(numbers, position)[SIDE // 2 + 8, SIDE // 2]) == scene.OWN
    frame = absolute_frame((numbers,), SIDE)
    first, last = (frame.point(*numbers.states[k, :2]) for k in (0, -1))
    # North is up, and it sails north.
    assert last[1] < first[1] - 100
    assert tuple(picture(numbers, 0, absolute=True)[round(first[1]), round(first[0])]) == scene.OWN


def test_the_absolute_frame_holds_everything_that_matters(world: World) -> None:
    for name in ("1", "2", "4", "6", "new"):
        numbers = sailed(world, name, (0, 3, 3))
        frame = absolute_frame((numbers,), SIDE)
        places = np.concatenate(
            (numbers.states[:, :2], numbers.ships[0], [numbers.case.start, numbers.case.goal])
        )
        pixels = frame.points(places)
        assert (pixels > 0).all() and (pixels < SIDE).all()


def test_hulls_to_scale_are_smaller_and_leave_a_ghost(world: World) -> None:
    numbers = sailed(world)
    large, true = picture(numbers, 5), picture(numbers, 5, to_scale=True)
    assert 0 < 8 * count(true, scene.TARGET) < count(large, scene.TARGET)
    # The ghost runs where the large hull ends.
    was = (large == scene.TARGET).all(-1)
    now = (true != picture(numbers, 0, to_scale=True)).any(-1)
    assert (was & now).sum() > 50


def test_it_glides(world: World) -> None:
    numbers = sailed(world)
    frames = [picture(numbers, 4 + k / 12, absolute=True) for k in range(4)]
    for one, other in pairwise(frames):
        assert (one != other).any()
    assert (picture(numbers, 4) == picture(numbers, 4)).all()


def test_it_says_how_it_ended(world: World) -> None:
    numbers = sailed(world, "4", (3,))
    assert numbers.outcome == "collision"
    at_end, before = picture(numbers, numbers.steps), picture(numbers, numbers.steps - 1e-3)
    top = slice(0, SIDE // 12), slice(SIDE // 3, 2 * SIDE // 3)
    assert (at_end[top] != before[top]).any()
