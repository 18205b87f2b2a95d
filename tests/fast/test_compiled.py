"""The compiled rasteriser equals the torch code; compiled steps are in tests/sim/test_invariants.py."""

import math
from dataclasses import replace

import pytest
import torch

from ship_trl.fast.step import CompiledStep
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim.cases import TargetShip, load_case, load_world
from ship_trl.sim.state import GOAL_X, HEADING, OWN_SIZE, SHIP_HEADING, SPEED, STEP, X, Y
from ship_trl.sim.transition import Transition
from tests.sim.pictures import compiled_difference
from tests.sim.scenes import scenes

WORLD = load_world()
NAMES = ("1", "2", "4", "6", "new")
CASES = {name: load_case(name, WORLD) for name in NAMES}
DRAW = {colour: make_rasteriser(WORLD, colour=colour) for colour in (False, True)}


def states(name: str, count: int, seed: int) -> torch.Tensor:
    """Return random states of a case inside and outside the picture, with any heading and whole steps."""
    generator = torch.Generator().manual_seed(seed)
    spread = torch.tensor([1600.0, 1600.0, 4 * math.pi, 61.0])
    state = torch.rand(count, 4, generator=generator) * spread
    state -= torch.tensor([800.0, 500.0, 2 * math.pi, 0.0])
    state[:, 3].floor_()
    return scenes(CASES[name], WORLD, state)


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_the_reference_picture(name: str, colour: bool) -> None:
    draw, state = DRAW[colour], states(name, 600, 2)
    difference = compiled_difference(draw, state)
    assert difference.max() <= 1 and (difference > 0).float().mean() < 1e-5
    # A difference of one is rounding; a shape left out would be far more.
    assert (draw(state) != draw.background).flatten(1).any(1).all()


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("vector_time", [5.0, 20.0, 300.0])
def test_speed_vectors_are_those_of_the_reference(vector_time: float, colour: bool) -> None:
    draw = make_rasteriser(WORLD, colour=colour, vector_time=vector_time)
    state = states("6", 400, 4)
    state[:, SPEED] = torch.linspace(-5.0, 20.0, 400)
    difference = compiled_difference(draw, state)
    assert difference.max() <= 1 and (difference > 0).float().mean() < 1e-4
    # No picture leaves a trace in the next one.
    assert torch.equal(draw(state[-1:]), draw(state)[-1:])


@pytest.mark.parametrize("off", [0.0, 1e-38, 1e-25, 3e-22, 1e-10, 1e-6, 1e-3])
def test_at_the_goal_the_line_is_a_dot(off: float) -> None:
    state = scenes(CASES["1"], WORLD, [[off, 600.0, 1.0, 5.0]])
    assert compiled_difference(DRAW[False], state).max() <= 1


@pytest.mark.parametrize("column", [X, Y, HEADING, STEP, GOAL_X, OWN_SIZE + SHIP_HEADING])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2e9])
def test_a_state_that_is_not_finite_is_refused(column: int, value: float) -> None:
    state = scenes(CASES["4"], WORLD, torch.zeros(3, 4))
    state[1, column] = value
    with pytest.raises(ValueError, match="is not finite, or beyond 1e9"):
        DRAW[False](state)
    # The failed call leaves no trace in the next picture.
    assert torch.equal(DRAW[False](state[:1]), DRAW[False](state[2:]))


@pytest.mark.parametrize("far", [2e3, 1e6, 3e8])
def test_far_away_is_drawn_as_the_reference_does(far: float) -> None:
    # Multiples of 45 degrees put the line on an axis or a diagonal, wherever rounding puts it.
    turns = torch.arange(0, 2 * math.pi, math.pi / 40)
    row = torch.stack([far * turns.cos(), far * turns.sin(), turns * 3, turns], dim=1)
    assert compiled_difference(DRAW[False], scenes(CASES["4"], WORLD, row)).max() <= 1


@pytest.mark.parametrize("turn", [0.0, 1e-45, -1e-45, 1e-38, math.pi / 2, math.pi, -math.pi / 2])
def test_a_ship_along_the_pictures_axes_equals_the_reference(turn: float) -> None:
    case = replace(load_case("1", WORLD), target_ships=[TargetShip(100.0, 100.0, 0.0, 0.0)])
    state = scenes(case, WORLD, [[0.0, 0.0, turn, 0.0]])
    assert compiled_difference(DRAW[False], state).max() <= 1


@pytest.mark.parametrize("action", [-1, 7])
def test_an_action_index_out_of_range_is_refused(action: int) -> None:
    step = CompiledStep(Transition(WORLD))
    with pytest.raises(IndexError, match="action index out of range"):
        step(states("1", 1, 0), torch.tensor([action]))
