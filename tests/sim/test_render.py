"""Properties of the network's picture, and the picture against one by supersampling."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, TargetShip, load_case, load_world
from ship_trl.sim.state import OWN_SIZE, SHIP_SPEED, SPEED, state_size
from tests.sim.pictures import supersampled
from tests.sim.scenes import scenes

WORLD = load_world()
CASES = {name: load_case(name, WORLD) for name in ("1", "4", "6")}
GREY, COLOUR = make_rasteriser(WORLD), make_rasteriser(WORLD, colour=True)
AHEAD = math.pi / 2

states = st.tuples(
    st.floats(-500, 500), st.floats(-500, 450), st.floats(-math.pi, math.pi), st.integers(0, 60).map(float)
)


def at(*values: float) -> Tensor:
    return torch.tensor([values], dtype=torch.float32)


def with_ship(x: float, y: float, heading: float) -> Case:
    return replace(CASES["1"], target_ships=[TargetShip(x, y, heading, 0.0)])


def draw(case: Case, rows: Tensor, colour: bool = False) -> Tensor:
    """Return the picture as integers [C, 84, 84]."""
    return (COLOUR if colour else GREY)(scenes(case, WORLD, rows))[0].int()


def pixel_of(state: Tensor, x: float, y: float) -> tuple[float, float]:
    """Return row and column of a position in pixels, not rounded."""
    own_x, own_y, heading, _ = state[0].tolist()
    east, north = x - own_x, y - own_y
    right = east * math.sin(heading) - north * math.cos(heading)
    ahead = east * math.cos(heading) + north * math.sin(heading)
    return 42 - ahead * scene.PIXELS_PER_METRE, 42 + right * scene.PIXELS_PER_METRE


@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3)])
def test_the_picture_is_uint8_of_the_states_shape(shape: tuple[int, ...]) -> None:
    state = scenes(CASES["6"], WORLD, torch.rand(*shape, 4) * 10)
    for rasteriser, channels in ((GREY, 1), (COLOUR, 3)):
        pixels = rasteriser(state)
        assert pixels.shape == (*shape, channels, 84, 84) and pixels.dtype == torch.uint8
        assert rasteriser.spec(torch.Size(shape)).is_in(pixels)


@given(st.lists(st.tuples(states, st.sampled_from(["1", "4", "6"])), min_size=2, max_size=6))
def test_rows_of_a_batch_may_be_different_cases(batch: list[tuple[tuple[float, ...], str]]) -> None:
    mixed = torch.zeros(len(batch), state_size(2))
    alone = [scenes(CASES[name], WORLD, [row]) for row, name in batch]
    for row, one in zip(mixed, alone, strict=True):
        row[: one.shape[1]] = one
    for draw in (GREY, COLOUR, lambda state: GREY.reference(state).view(-1, 1, 84, 84)):
        assert torch.equal(draw(mixed), torch.cat([draw(one) for one in alone]))


@given(states)
def test_grey_is_the_luminance_of_the_colours(state: tuple[float, ...]) -> None:
    colour = draw(CASES["6"], at(*state), colour=True).float()
    grey = (colour * torch.tensor(scene.LUMINANCE)[:, None, None]).sum(0)
    assert float((draw(CASES["6"], at(*state))[0] - grey).abs().max()) <= 1.01


@given(states, st.tuples(st.floats(-900, 900), st.floats(-900, 900), st.floats(-180, 180)))
def test_a_ship_changes_only_the_pixels_around_it(
    state: tuple[float, ...], ship: tuple[float, float, float]
) -> None:
    here = at(*state)
    rows, columns = (draw(with_ship(*ship), here) != draw(CASES["1"], here))[0].nonzero().unbind(-1)
    row, column = pixel_of(here, *ship[:2])
    distance = torch.hypot(rows + 0.5 - row, columns + 0.5 - column)
    # The blur reaches farthest off the sharp bow.
    assert bool((distance <= 0.5 * scene.TARGET_LENGTH * scene.PIXELS_PER_METRE + 1.5).all())
    assert len(rows) >= 12 or not (3 < row < 81 and 3 < column < 81)


@given(states)
def test_the_line_changes_only_the_pixels_along_it(state: tuple[float, ...]) -> None:
    here = at(*state)
    background = GREY.background[0].int()
    rows, columns = (draw(CASES["1"], here)[0] != background).nonzero().unbind(-1)
    row, column = pixel_of(here, *CASES["1"].goal)
    length = math.hypot(row - 42, column - 42)
    down, right = (row - 42) / length, (column - 42) / length
    along = (rows + 0.5 - 42) * down + (columns + 0.5 - 42) * right
    across = (rows + 0.5 - 42) * right - (columns + 0.5 - 42) * down
    assert bool((across.abs() <= 1.01).all())
    # It begins at own ship and stops at the goal.
    assert float(along.min()) >= -1.01 and float(along.max()) <= length + 1.01
    assert float(along.max()) >= min(length, 40.0) - 1.5


def test_own_ship_on_the_goal_is_drawn() -> None:
    on, beside = (draw(CASES["4"], at(x, 600.0, AHEAD, 40.0)) for x in (0.0, -0.01))
    assert int((on - beside).abs().max()) <= 2


VECTORS = partial(make_rasteriser, WORLD, vector_time=20.0)


def test_without_a_vector_time_no_vectors_are_drawn() -> None:
    state = scenes(CASES["4"], WORLD, [[20.0, 200.0, 1.9, 12.0]])
    fast = state.clone()
    fast[:, SPEED] = 3.0
    assert torch.equal(GREY(fast), GREY(state))
    assert not torch.equal(VECTORS()(state), GREY(state))


@pytest.mark.parametrize("place", [SPEED, OWN_SIZE + SHIP_SPEED])
@pytest.mark.parametrize("fast", [False, True])
def test_two_speeds_give_two_pictures(place: int, fast: bool) -> None:
    draw = VECTORS(fast=fast)
    slow = scenes(CASES["4"], WORLD, [[20.0, 150.0, 1.9, 5.0]])
    quick = slow.clone()
    slow[:, place], quick[:, place] = 8.0, 12.0
    assert int((draw(slow).int() - draw(quick).int()).abs().max()) > 40


@given(st.floats(-180, 180), st.floats(1.0, 18.0))
def test_a_vector_is_the_way_of_the_bow(heading: float, speed: float) -> None:
    here, place = at(0.0, 0.0, AHEAD, 0.0), (-180.0, 180.0)
    case = replace(with_ship(*place, heading), target_ships=[TargetShip(*place, heading, speed)])
    with_vector, without = (
        draw(scenes(case, WORLD, here))[0, 1].float() for draw in (VECTORS(colour=True), COLOUR)
    )
    changed = (with_vector - without)[:, :41]  # own ship's vector is in the middle
    ahead = torch.tensor([math.cos(math.radians(heading)), math.sin(math.radians(heading))])
    ink = changed / (scene.TARGET[1] - scene.DISC[1])
    rows, columns = (ink > 0.3).nonzero().unbind(-1)
    metres = torch.stack((columns + 0.5 - 42, 42 - rows - 0.5), -1) / scene.PIXELS_PER_METRE
    along = (metres - torch.tensor(place)) @ ahead
    # Up to a pixel and a half of 15 m, and but for pixels that ship or line cover.
    bow = scene.TARGET_LENGTH / 2
    assert along.numel() and float(along.min()) > bow - 23 and float(along.max()) < bow + 20 * speed + 23
    if bow + 20 * speed < 150:
        assert float(along.max()) > bow + 20 * speed - 23


@given(st.floats(-180, 180), st.sampled_from([(200.0, 200.0), (-250.0, 100.0), (300.0, -150.0)]))
def test_bow_and_stern_are_told_apart(heading: float, place: tuple[float, float]) -> None:
    here = at(0.0, 0.0, AHEAD, 0.0)
    change = draw(with_ship(*place, heading), here) - draw(with_ship(*place, heading + 180), here)
    assert int(change.abs().max()) > 60 and int(change.abs().sum()) > 400


@given(st.floats(-math.pi, math.pi), st.floats(1.05, 3.0))
def test_a_ship_outside_is_not_seen(direction: float, far: float) -> None:
    radius = far * math.hypot(scene.VIEW_RADIUS + scene.TARGET_LENGTH, scene.VIEW_RADIUS)
    ship = with_ship(radius * math.cos(direction), radius * math.sin(direction), 20.0)
    here = at(0.0, 0.0, AHEAD, 0.0)
    assert torch.equal(draw(ship, here), draw(CASES["1"], here))


@given(st.floats(-math.pi, math.pi), st.floats(-3, 3), st.floats(-3, 3))
def test_a_ship_is_six_pixels_long(heading: float, x: float, y: float) -> None:
    here = at(0.0, 0.0, AHEAD, 0.0)
    ship = with_ship(300 + x * 10, 200 + y * 10, math.degrees(heading))
    share = (draw(ship, here, colour=True)[1] - scene.DISC[1]) / (scene.TARGET[1] - scene.DISC[1])
    rows, columns = (share > 0.5).nonzero().unbind(-1)
    ahead = columns * math.cos(heading) - rows * math.sin(heading)
    assert float(ahead.max() - ahead.min()) + 1 >= 6
    # The ink's area is the ship's area.
    area = 0.45 * 0.7 * (scene.TARGET_LENGTH * scene.PIXELS_PER_METRE) ** 2
    assert float(share[15:42, 50:75].clamp(min=0).sum()) == pytest.approx(area, rel=0.15)


@given(st.floats(-math.pi, math.pi))
def test_a_fifth_of_a_pixel_is_seen(direction: float) -> None:
    step = 0.2 / scene.PIXELS_PER_METRE
    here = at(0.0, 0.0, AHEAD, 0.0)
    moved = with_ship(250 + step * math.cos(direction), 250 + step * math.sin(direction), 30.0)
    change = (draw(moved, here) - draw(with_ship(250, 250, 30.0), here)).abs()
    assert int(change.max()) >= 8


@pytest.mark.parametrize(
    ("name", "state"),
    [
        ("1", (0.0, 0.0, AHEAD, 0.0)),
        ("4", (20.0, 200.0, 1.9, 12.0)),
        ("4", (-300.0, 100.0, 0.3, 3.0)),
        ("6", (0.0, 100.0, 1.2, 8.0)),
        ("6", (150.0, 420.0, 3.0, 30.0)),
    ],
)
def test_the_picture_equals_supersampling(name: str, state: tuple[float, ...]) -> None:
    picture = draw(CASES[name], at(*state), colour=True).permute(1, 2, 0).numpy()
    error = np.abs(picture - supersampled(CASES[name], WORLD, list(state)))
    # Edges are blurred a little differently; a shape a pixel off would show more.
    assert error.mean() < 0.6 and np.quantile(error, 0.999) < 60


@pytest.mark.parametrize(
    "place", [(640, 100), (-655, -300), (50, -640), (-200, 625), (630, 630), (-650, 640), (600, -640)]
)
def test_a_ship_cut_by_the_edge_is_drawn_right(place: tuple[float, float]) -> None:
    here, case = (0.0, 0.0, AHEAD, 0.0), with_ship(*place, 25.0)
    ship = draw(case, at(*here), colour=True) - draw(CASES["1"], at(*here), colour=True)
    slow = supersampled(case, WORLD, list(here)) - supersampled(CASES["1"], WORLD, list(here))
    assert np.abs(slow).max() > 50
    # The blurred edges differ; a patch drawn a pixel off would differ by all of the ship.
    error = np.abs(ship.permute(1, 2, 0).numpy() - slow)
    assert error.max() < 80 and error.sum() < 0.25 * np.abs(slow).sum()
