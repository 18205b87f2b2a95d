"""The people's picture is the network's, drawn large: structural similarity holds them together."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.render import Rasteriser
from ship_trl.view.draw import draw_scene, to_array

Picture = NDArray[np.float64]

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


def network_view(case: Case, world: World, state: tuple[float, ...]) -> Picture:
    pixels = Rasteriser(case, world, colour=True)(torch.tensor(state))
    return np.asarray(pixels.permute(1, 2, 0).double().numpy())


def people_view(case: Case, world: World, state: tuple[float, ...]) -> Picture:
    """The large picture, each 8 x 8 pixels averaged."""
    large = to_array(draw_scene(case, world, state, scene.SIZE * TIMES))
    return np.asarray(large.reshape(scene.SIZE, TIMES, scene.SIZE, TIMES, 3).mean((1, 3)))


def window_mean(picture: Picture) -> Picture:
    """Mean of every 7 x 7 window: [H, W, 3] to [H - 6, W - 6, 3]."""
    for axis in (0, 1):
        sums = np.cumsum(np.insert(picture, 0, 0.0, axis), axis)
        low, high = np.arange(sums.shape[axis] - WINDOW), np.arange(WINDOW, sums.shape[axis])
        picture = (sums.take(high, axis) - sums.take(low, axis)) / WINDOW
    return picture


def compare(one: Picture, other: Picture) -> tuple[float, float]:
    """Structural similarity (Wang et al., 2004), mean over the colours and over 7 x 7 windows.

    Of all windows, and of those with anything in them: bare water is alike in any two pictures.
    """
    mean1, mean2 = window_mean(one), window_mean(other)
    var1, var2 = window_mean(one * one) - mean1**2, window_mean(other * other) - mean2**2
    covariance = window_mean(one * other) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    means = (2 * mean1 * mean2 + c1) / (mean1**2 + mean2**2 + c1)
    similar = (means * (2 * covariance + c2) / (var1 + var2 + c2)).mean(-1)
    busy = np.maximum(var1, var2).max(-1) > 1.0
    return float(similar.mean()), float(similar[busy].mean())


@pytest.mark.parametrize("name", CASES)
def test_people_and_network_see_the_same(world: World, name: str) -> None:
    case = load_case(name, world)
    for state in STATES:
        whole, parts = compare(network_view(case, world, state), people_view(case, world, state))
        assert whole > 0.997, state
        assert parts > 0.99, state


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param((0.0, 120.0, 1.40, 8.0), id="heading"),
        pytest.param((0.0, 120.0, 1.25, 11.0), id="target ships"),
        pytest.param((30.0, 120.0, 1.25, 8.0), id="place"),
    ],
)
def test_a_wrong_state_is_told_apart(world: World, wrong: tuple[float, ...]) -> None:
    case, state = load_case("4", world), (0.0, 120.0, 1.25, 8.0)
    seen = network_view(case, world, state)
    right, off = (
        compare(seen, people_view(case, world, state)),
        compare(seen, people_view(case, world, wrong)),
    )
    assert off[0] < right[0] - 0.008
    assert off[1] < right[1] - 0.04


def test_a_missing_ship_is_told_apart(world: World) -> None:
    state = (0.0, 120.0, 1.25, 8.0)
    seen = network_view(load_case("4", world), world, state)
    assert compare(seen, people_view(load_case("3", world), world, state))[1] < 0.97


def test_colours_are_the_scenes(world: World, make_case: Callable[..., Case]) -> None:
    """Own ship at (100, 0) heading east: astern of it is west, a target ship 300 m on port side."""
    case = make_case((100.0, 300.0, 0.0, 0.0))
    picture = to_array(draw_scene(case, world, torch.tensor([100.0, 0.0, 0.0, 5.0]), 640))
    at = lambda right, ahead: tuple(picture[round(320 - ahead / 2), round(320 + right / 2)])  # noqa: E731
    assert at(-630, 630) == scene.OUTSIDE
    assert at(0, -200) == scene.DISC
    assert at(0, -52) == scene.GOAL_CIRCLE
    assert at(35, -20) == scene.SAFE_CIRCLE
    assert at(0, -25) == scene.OWN
    assert at(-300, 0) == scene.TARGET
    # The goal is 100 m astern and 600 m on port side.
    assert at(-540, -90) == scene.LINE


def test_tracks_are_an_addition(world: World, make_case: Callable[..., Case]) -> None:
    case = make_case((-300.0, 150.0, 0.0, 15.0))
    states = torch.tensor([[0.0, 15.0 * k, 1.5708, k] for k in range(9)])
    bare = to_array(draw_scene(case, world, states[8], 320))
    again = to_array(draw_scene(case, world, states[8], 320, states[:0]))
    tracked = to_array(draw_scene(case, world, states[8], 320, states[:8]))
    assert (bare == again).all()
    changed = np.argwhere((bare != tracked).any(-1))
    # Own ship's past is below the middle, the target ship's along a level line to the left of it.
    metres = (changed - 159.5) * 4.0
    own = np.abs(metres[:, 1]) < 8
    assert own.any() and (~own).any()
    assert (metres[own, 0] > 0).all() and (metres[own, 0] < 130).all()
    assert (metres[~own, 1] < -170).all() and (np.abs(metres[~own, 0] + 30) < 8).all()


def test_a_short_state_is_refused(world: World, make_case: Callable[..., Case]) -> None:
    with pytest.raises(ValueError, match="got 3 numbers"):
        draw_scene(make_case(), world, [0.0, 0.0, 1.57])
