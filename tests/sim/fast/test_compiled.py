"""The compiled rasteriser equals the torch code; compiled steps are in tests/sim/test_invariants.py."""

import math
from dataclasses import replace

import pytest
import torch

from ship_trl.sim.cases import TargetShip, load_case, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition
from tests.sim.pictures import compiled_difference

WORLD = load_world()
NAMES = ("1", "2", "4", "6", "new")
DRAW = {
    (name, colour): Rasteriser(load_case(name, WORLD), WORLD, colour=colour)
    for name in NAMES
    for colour in (False, True)
}


def states(count: int, seed: int) -> torch.Tensor:
    """Return random states inside and outside the picture, with any heading and whole steps."""
    generator = torch.Generator().manual_seed(seed)
    spread = torch.tensor([1600.0, 1600.0, 4 * math.pi, 61.0])
    state = torch.rand(count, 4, generator=generator) * spread
    state -= torch.tensor([800.0, 500.0, 2 * math.pi, 0.0])
    state[:, 3].floor_()
    return state


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_the_reference_picture(name: str, colour: bool) -> None:
    draw, state = DRAW[name, colour], states(2000, 2)
    difference = compiled_difference(draw, state)
    assert difference.max() <= 1 and (difference > 0).float().mean() < 1e-5
    # A difference of one is rounding; a shape left out would be far more.
    assert (draw(state) != draw.background).flatten(1).any(1).all()


def test_odd_layouts_of_states_are_drawn_alike() -> None:
    draw, state = DRAW["4", True], states(6, 3)
    assert torch.equal(draw(state.t().contiguous().t()), draw(state))
    assert torch.equal(draw(state.view(2, 3, 4)).flatten(0, 1), draw(state))
    assert torch.equal(draw(state.double()), draw(state))


@pytest.mark.parametrize("off", [0.0, 1e-38, 1e-25, 3e-22, 1e-10, 1e-6, 1e-3])
def test_at_the_goal_the_line_is_a_dot(off: float) -> None:
    state = torch.tensor([[off, 600.0, 1.0, 5.0]])
    assert compiled_difference(DRAW["1", False], state).max() <= 1


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2e9])
def test_a_state_that_is_not_finite_is_refused(column: int, value: float) -> None:
    state = torch.zeros(3, 4)
    state[1, column] = value
    with pytest.raises(ValueError, match="is not finite, or beyond 1e9"):
        DRAW["4", False](state)
    # The failed call leaves no trace in the next picture.
    assert torch.equal(DRAW["4", False](state[:1]), DRAW["4", False](torch.zeros(1, 4)))


@pytest.mark.parametrize("far", [2e3, 1e6, 3e8])
def test_far_away_is_drawn_as_the_reference_does(far: float) -> None:
    # Multiples of 45 degrees put the line on an axis or a diagonal, wherever rounding puts it.
    turns = torch.arange(0, 2 * math.pi, math.pi / 40)
    state = torch.stack([far * turns.cos(), far * turns.sin(), turns * 3, turns], dim=1)
    assert compiled_difference(DRAW["4", False], state).max() <= 1


@pytest.mark.parametrize("turn", [0.0, 1e-45, -1e-45, 1e-38, math.pi / 2, math.pi, -math.pi / 2])
def test_a_ship_along_the_pictures_axes_equals_the_reference(turn: float) -> None:
    case = replace(load_case("1", WORLD), target_ships=[TargetShip(100.0, 100.0, 0.0, 0.0)])
    state = torch.tensor([[0.0, 0.0, turn, 0.0]])
    assert compiled_difference(Rasteriser(case, WORLD), state).max() <= 1


@pytest.mark.parametrize("action", [-1, 7])
def test_an_action_index_out_of_range_is_refused(action: int) -> None:
    step = CompiledStep(Transition(load_case("1", WORLD), WORLD, torch.device("cpu")))
    with pytest.raises(IndexError, match="action index out of range"):
        step(states(1, 0), torch.tensor([action]))


def test_an_encoder_is_observed_at_every_step_and_start() -> None:
    def double(state: torch.Tensor) -> torch.Tensor:
        return state.to(torch.bfloat16) * 2

    env = ShipEnv(load_case("3", WORLD), WORLD, 4, encoders={"features": double})
    assert env.observation_spec["features"].shape == (4, 4)
    current = env.reset()
    for _ in range(30):
        current["action"] = torch.full((4,), 3)
        stepped, current = env.step_and_maybe_reset(current)
        for step in (stepped, stepped["next"], current):
            assert torch.equal(step["features"], double(step["state"]))
