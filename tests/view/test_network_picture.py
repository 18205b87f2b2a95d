"""The network's picture is the one that pygame draws large, from the same sizes and colours."""

import math

import numpy as np
import pygame
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.state import GOAL_X, GOAL_Y, HEADING, SHIP_COUNT, SPEED, target_ships
from ship_trl.view import pen
from ship_trl.view.painter import relative_frame
from tests.sim.scenes import scenes

Picture = NDArray[np.float64]
Place = tuple[float, ...]

TIMES = 8
WINDOW = 7
STATES = [
    (0.0, 0.0, 1.5708, 0.0),
    (0.0, 285.0, 1.5708, 19.0),
    (-50.0, 150.0, 2.2, 12.0),
    (100.0, 300.0, 0.4, 20.0),
    (300.0, -200.0, 1.2, 30.0),
    (-200.0, 300.0, 4.0, 25.0),
    (0.0, 540.0, 1.57, 36.0),
]
CASES = ["1", "2", "3", "4", "5", "6", "new"]


def network_picture(case: Case, world: World, state: Place, vector_time: float = 0.0) -> Picture:
    pixels = make_rasteriser(world, colour=True, vector_time=vector_time)(scenes(case, world, [state])[0])
    return np.asarray(pixels.permute(1, 2, 0).double().numpy())


def draw_large(world: World, state: Tensor, side: int, vector_time: float = 0.0) -> pygame.Surface:
    """Draw the scene of a state [S] as the network sees it, as a square of `side` pixels."""
    row, picture = state.double().numpy(), pen.new_surface(side, side)
    frame, width = relative_frame(row, side), scene.LINE_WIDTH * side / scene.SIZE
    middle = (side / 2, side / 2)
    picture.fill(scene.OUTSIDE)
    pen.circle(picture, scene.DISC, middle, scene.VIEW_RADIUS * frame.scale)
    pen.circle(picture, scene.GOAL_CIRCLE, middle, world.goal_distance * frame.scale)
    pen.circle(picture, scene.SAFE_CIRCLE, middle, world.safe_distance * frame.scale)
    ships = target_ships(state)[: int(state[SHIP_COUNT])].double().numpy()
    hulls = [(scene.OWN, scene.OWN_LENGTH, row[: HEADING + 1], row[SPEED])]
    hulls += [(scene.TARGET, scene.TARGET_LENGTH, ship[:3], ship[3]) for ship in ships]
    own, *targets = hulls
    pen.polygon(picture, own[0], frame.hull(own[2], own[1]))
    pen.strip(picture, scene.LINE, middle, frame.point(row[GOAL_X], row[GOAL_Y]), width)
    for colour, length, pose, speed in hulls if vector_time else []:
        ahead = np.array([math.cos(pose[HEADING]), math.sin(pose[HEADING])])
        bow = pose[:2] + length / 2 * ahead
        end = bow + speed * vector_time * ahead
        pen.strip(picture, colour, frame.point(*bow), frame.point(*end), width)
    for colour, length, pose, _ in targets:
        pen.polygon(picture, colour, frame.hull(pose, length))
    return picture


def large_picture(case: Case, world: World, state: Place, vector_time: float = 0.0) -> Picture:
    """The large picture, each 8 x 8 pixels averaged."""
    here = scenes(case, world, [state])[0]
    large = pen.to_array(draw_large(world, here, scene.SIZE * TIMES, vector_time))
    return np.asarray(large.reshape(scene.SIZE, TIMES, scene.SIZE, TIMES, 3).mean((1, 3)))


def compare(one: Picture, other: Picture) -> tuple[float, float]:
    """Structural similarity (Wang et al., 2004), mean over the colours and over 7 x 7 windows.

    Of all windows, and of those with anything in them: bare water is alike in any two pictures.
    """

    def mean(values: Picture) -> Picture:
        return np.asarray(uniform_filter(values, (WINDOW, WINDOW, 1)))

    mean1, mean2 = mean(one), mean(other)
    var1, var2 = mean(one * one) - mean1**2, mean(other * other) - mean2**2
    covariance = mean(one * other) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    means = (2 * mean1 * mean2 + c1) / (mean1**2 + mean2**2 + c1)
    similar = (means * (2 * covariance + c2) / (var1 + var2 + c2)).mean(-1)
    busy = np.maximum(var1, var2).max(-1) > 1.0
    return float(similar.mean()), float(similar[busy].mean())


@pytest.mark.parametrize("name", CASES)
def test_the_two_pictures_are_the_same(world: World, name: str) -> None:
    case = load_case(name, world)
    for state in STATES:
        whole, parts = compare(network_picture(case, world, state), large_picture(case, world, state))
        assert whole > 0.997, state
        assert parts > 0.99, state


def test_speed_vectors_are_the_same(world: World) -> None:
    case = load_case("6", world)
    for state in STATES:
        network, large = (draw(case, world, state, 20.0) for draw in (network_picture, large_picture))
        whole, parts = compare(network, large)
        assert whole > 0.995 and parts > 0.985, state
        assert compare(network, network_picture(case, world, state))[0] < whole
