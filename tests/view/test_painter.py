"""The map for people: it stays still, hulls are to scale, and only danger is red."""

import math
from dataclasses import replace

import numpy as np
import pygame
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, TargetShip, load_case, load_world
from ship_trl.sim.scale import Scale
from ship_trl.sim.state import initial_state
from ship_trl.view import pen
from ship_trl.view.episode import Telemetry, measure_episode
from ship_trl.view.painter import (
    SMALL_SIDE,
    TRUE_LENGTH,
    draw_scene,
    hull_length,
    map_frame,
    paint_scene,
    place_labels,
    relative_frame,
    still,
)
from ship_trl.view.style import DANGER, GOAL_MARK
from tests.view.episodes import run_actions

SIDE = 840
START = "2025-06-01 23:50:00+00:00"


def measured(world: World, case: str = "4", plan: tuple[int, ...] = (3, 4)) -> Telemetry:
    chosen = load_case(case, world)
    return measure_episode(world, run_actions(chosen, world, plan))


def picture(
    telemetry: Telemetry, position: float, relative: bool = False, large: bool = False
) -> NDArray[np.uint8]:
    surface, frame = pen.new_surface(SIDE, SIDE), map_frame((telemetry,), SIDE)
    if relative:
        frame = relative_frame(telemetry.at(position)[0], SIDE)
    paint_scene(surface, telemetry, position, frame, large)
    return pen.to_array(surface)


def count(pixels: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    return int((pixels == colour).all(-1).sum())


def test_own_ship_moves_on_a_still_map_or_stays_in_the_middle(world: World) -> None:
    telemetry = measured(world)
    for position in (0.0, 3.5, 9.0):
        own = telemetry.at(position)[0]
        assert relative_frame(own, SIDE).point(own[0], own[1]) == pytest.approx((SIDE / 2, SIDE / 2))
        assert tuple(picture(telemetry, position, relative=True)[SIDE // 2 + 2, SIDE // 2]) == scene.OWN
    frame = map_frame((telemetry,), SIDE)
    first, last = (frame.point(*telemetry.states[k, :2]) for k in (0, -1))
    # North is up, and the ship goes north.
    assert last[1] < first[1] - 100
    assert tuple(picture(telemetry, 0)[round(first[1]) + 2, round(first[0])]) == scene.OWN


def test_the_map_holds_everything_that_matters(world: World) -> None:
    for name in ("1", "2", "4", "6", "new"):
        telemetry, case = measured(world, name, (0, 3, 3)), load_case(name, world)
        frame = map_frame((telemetry,), SIDE)
        places = np.concatenate((telemetry.states[:, :2], telemetry.ships[0], [case.start, case.goal]))
        pixels = frame.points(places)
        assert (pixels > 0).all() and (pixels < SIDE).all()


def test_the_map_of_single_states_of_an_episode_stays_still(world: World) -> None:
    """As an environment draws them: the goal is at one place."""
    states = measured(world, "4", (3, 4)).states
    goals = []
    for row in states[[0, 5, 10]]:
        start, state = (torch.from_numpy(one).float() for one in (states[0], row))
        pixels = pen.to_array(draw_scene(world, state, SIDE, start))
        goals.append(np.argwhere((pixels == GOAL_MARK).all(-1)).mean(0))
    assert np.ptp(goals, axis=0).max() < 1


@given(safe=st.floats(5, 500), scale=st.floats(0.001, 5))
def test_a_hull_is_to_scale_or_nine_pixels_and_never_longer_than_is_safe(safe: float, scale: float) -> None:
    world = replace(load_world(), safe_distance=safe)
    length = hull_length(world, scale)
    reach = max(math.hypot(*corner) for corner in scene.ship_outline(length))
    assert 2 * reach < safe
    assert length == min(safe / 1.2, max(TRUE_LENGTH, 9 / scale))


def test_red_is_only_where_a_ship_is_inside_the_safe_distance(world: World) -> None:
    telemetry = measured(world, "4", (3,))
    assert telemetry.outcome == "collision"
    last = telemetry.steps
    is_red = [count(picture(telemetry, k)[SIDE // 8 :], DANGER) > 0 for k in range(last + 1)]
    assert is_red == [bool(apart.min() < world.safe_distance) for apart in telemetry.apart[:-1]] + [True]
    assert not any(is_red[:-2]) and count(picture(telemetry, 0), GOAL_MARK) > 100


def random_scene(draw: np.random.Generator, world: World) -> Telemetry:
    """A scene of up to eight ships, often close together, so that their labels compete for places."""
    spread, middle = draw.choice([20.0, 80.0, 400.0]), draw.uniform(-300, 600, 2)
    places = middle + draw.uniform(-spread, spread, (draw.integers(0, 9), 2))
    ships = [TargetShip(x, y, draw.uniform(-180, 180), 10.0) for x, y in places.tolist()]
    case = Case([0.0, 0.0], draw.uniform(-180, 180), draw.uniform(-600, 600, 2).tolist(), "drawn", ships)
    scene = still(world, initial_state(case, world))
    scene.outcome = (None, "goal", "collision", "timeout")[draw.integers(4)]
    return scene


def test_labels_never_overlap_and_every_ship_in_sight_has_one(world: World) -> None:
    draw = np.random.default_rng(0)
    for _ in range(500):
        one, side = random_scene(draw, world), int(draw.integers(SMALL_SIDE, 1800))
        frame = map_frame((one,), side) if draw.integers(2) else relative_frame(one.at(0.0)[0], side)
        sea = (None, Scale(12.35, 0.41), Scale(12.35, 0.41, START))[draw.integers(3)]
        found = place_labels(one, 0.0, frame, large=bool(draw.integers(2)), sea=sea)
        boxes, picture = list(found.values()), pygame.Rect(0, 0, side, side)
        assert all(picture.contains(box) for box in boxes)
        assert not any(box.collidelist(boxes[:k]) >= 0 for k, box in enumerate(boxes))
        places = frame.points(one.ships[0]).tolist()
        in_sight = {str(k) for k, at in enumerate(places, 1) if picture.collidepoint(at)}
        assert {name for name in found if name.isdecimal()} == in_sight
        assert one.outcome is None or one.outcome.upper() in found


def test_a_label_keeps_its_place_beside_its_ship_unless_that_is_taken(world: World) -> None:
    """Two ships on one place: the second number gives way, and stays near."""
    ships = [TargetShip(100.0, 300.0, 90.0, 10.0), TargetShip(101.0, 300.0, 90.0, 10.0)]
    pair = Case([0.0, 0.0], 90.0, [0.0, 600.0], "drawn", ships)
    alone, both = (
        still(world, initial_state(replace(pair, target_ships=ships[:count]), world)) for count in (1, 2)
    )
    frame = map_frame((both,), SIDE)
    first, second = place_labels(alone, 0.0, frame), place_labels(both, 0.0, frame)
    assert first["1"] == second["1"]
    assert math.dist(second["2"].center, frame.point(101.0, 300.0)) < 3 * second["2"].width


def test_a_scene_of_another_tool_has_a_second_bar_and_a_clock(world: World) -> None:
    """A bar of a nautical mile is as long as 1852 m at sea are in the picture."""
    telemetry, sea = measured(world), Scale(12.35, 0.41, START)
    frame = map_frame((telemetry,), SIDE)
    own = place_labels(telemetry, 20.0, frame)
    assert not any(words.endswith(("NM", "UTC", "min")) for words in own)
    found = place_labels(telemetry, 20.0, frame, sea=sea)
    (bar,) = (words for words in found if words.endswith(" NM"))
    pixels = found[bar].width - 2 * 0.022 * SIDE
    assert pixels == pytest.approx(float(bar.split()[0]) * 1852 / 12.35 * frame.scale, abs=1)
    # A step is 12.35 / 0.41 = 30.1 s: 20 of them end at midnight.
    assert "00:00 UTC" in found and own.keys() < found.keys()
    assert "+10 min" in place_labels(telemetry, 20.0, frame, sea=replace(sea, start=""))
