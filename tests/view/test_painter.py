"""The picture for people is the network's, drawn large, in both frames and with additions."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.render import Rasteriser
from ship_trl.view import pen
from ship_trl.view.painter import absolute_frame, draw_scene, paint_scene, relative_frame
from ship_trl.view.telemetry import Telemetry, measure_episode
from tests.sim.scenes import scenes
from tests.view.episodes import run_actions

Picture = NDArray[np.float64]
Place = tuple[float, ...]

TIMES = 8
WINDOW = 7
SIDE = 840
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
    pixels = Rasteriser(world, colour=True, vector_time=vector_time)(scenes(case, world, [state])[0])
    return np.asarray(pixels.permute(1, 2, 0).double().numpy())


def people_picture(case: Case, world: World, state: Place, vector_time: float = 0.0) -> Picture:
    """The large picture, each 8 x 8 pixels averaged."""
    here = scenes(case, world, [state])[0]
    large = pen.to_array(draw_scene(case, world, here, scene.SIZE * TIMES, vector_time))
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
        whole, parts = compare(network_picture(case, world, state), people_picture(case, world, state))
        assert whole > 0.997, state
        assert parts > 0.99, state


def test_people_and_network_see_the_same_speed_vectors(world: World) -> None:
    case = load_case("6", world)
    for state in STATES:
        network, people = (draw(case, world, state, 20.0) for draw in (network_picture, people_picture))
        whole, parts = compare(network, people)
        assert whole > 0.995 and parts > 0.985, state
        assert compare(network, network_picture(case, world, state))[0] < whole


def test_colours_are_the_scenes(world: World, make_case: Callable[..., Case]) -> None:
    """Own ship at (100, 0) heading east: astern of it is west, a target ship 300 m on port side."""
    case = make_case((100.0, 300.0, 0.0, 0.0))
    picture = pen.to_array(draw_scene(case, world, scenes(case, world, [[100.0, 0.0, 0.0, 5.0]])[0], 640))
    at = lambda right, ahead: tuple(picture[round(320 - ahead / 2), round(320 + right / 2)])  # noqa: E731
    assert at(-630, 630) == scene.OUTSIDE
    assert at(0, -200) == scene.DISC
    assert at(0, -52) == scene.GOAL_CIRCLE
    assert at(35, -20) == scene.SAFE_CIRCLE
    assert at(0, -25) == scene.OWN
    assert at(-300, 0) == scene.TARGET
    # The goal is 100 m astern and 600 m on port side.
    assert at(-540, -90) == scene.LINE


def measured(world: World, case: str = "4", plan: tuple[int, ...] = (3, 4)) -> Telemetry:
    chosen = load_case(case, world)
    return measure_episode(chosen, world, run_actions(chosen, world, plan))


def picture(
    telemetry: Telemetry, position: float, absolute: bool = False, to_scale: bool = False, plain: bool = False
) -> NDArray[np.uint8]:
    surface = pen.new_surface(SIDE, SIDE)
    frame = absolute_frame((telemetry,), SIDE) if absolute else None
    paint_scene(surface, telemetry, position, frame, to_scale, plain)
    return pen.to_array(surface)


def count(pixels: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((pixels == colour).all(-1).sum())


def test_additions_for_people_cover_little(world: World) -> None:
    telemetry = measured(world)
    apart = np.abs(picture(telemetry, 8).astype(int) - picture(telemetry, 8, plain=True)).max(-1)
    assert 0.005 < (apart > 40).mean() < 0.06
    # Own ship's track is below the middle.
    below = apart[SIDE // 2 + 40 : SIDE // 2 + 80, SIDE // 2 - 20 : SIDE // 2 + 20]
    assert (below > 40).any()


def test_own_ship_stays_in_the_middle_of_one_frame_and_moves_in_the_other(world: World) -> None:
    telemetry = measured(world)
    for position in (0.0, 3.5, 9.0):
        own = telemetry.at(position)[0]
        assert relative_frame(own, SIDE).point(own[0], own[1]) == pytest.approx((SIDE / 2, SIDE / 2))
        assert tuple(picture(telemetry, position)[SIDE // 2 + 8, SIDE // 2]) == scene.OWN
    frame = absolute_frame((telemetry,), SIDE)
    first, last = (frame.point(*telemetry.states[k, :2]) for k in (0, -1))
    # North is up, and the ship goes north.
    assert last[1] < first[1] - 100
    assert tuple(picture(telemetry, 0, absolute=True)[round(first[1]) + 4, round(first[0])]) == scene.OWN


def test_the_absolute_frame_holds_everything_that_matters(world: World) -> None:
    for name in ("1", "2", "4", "6", "new"):
        telemetry = measured(world, name, (0, 3, 3))
        frame, case = absolute_frame((telemetry,), SIDE), telemetry.case
        places = np.concatenate((telemetry.states[:, :2], telemetry.ships[0], [case.start, case.goal]))
        pixels = frame.points(places)
        assert (pixels > 0).all() and (pixels < SIDE).all()


def test_hulls_to_scale_are_smaller_inside_the_outline_of_the_large_ones(world: World) -> None:
    telemetry = measured(world)
    large, true = picture(telemetry, 5), picture(telemetry, 5, to_scale=True)
    assert 0 < 8 * count(true, scene.TARGET) < count(large, scene.TARGET)
    is_large = (large == scene.TARGET).all(-1)
    has_changed = (true != picture(telemetry, 0, to_scale=True)).any(-1)
    assert (is_large & has_changed).sum() > 50


def test_it_says_how_it_ended(world: World) -> None:
    telemetry = measured(world, "4", (3,))
    assert telemetry.outcome == "collision"
    at_end, before = picture(telemetry, telemetry.steps), picture(telemetry, telemetry.steps - 1e-3)
    top = slice(0, SIDE // 12), slice(SIDE // 3, 2 * SIDE // 3)
    assert (at_end[top] != before[top]).any()
