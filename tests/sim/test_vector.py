"""The scene as numbers: what they are, and that only relative places count."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.state import (
    OWN_SIZE,
    SHIP_COUNT,
    SHIP_SIZE,
    SPEED,
    STEP,
    is_present,
    relative_positions,
    state_size,
)
from ship_trl.sim.vector import VectorObservation
from tests.sim.anywhere import Scenario, scenarios
from tests.sim.moving import moved_case
from tests.sim.scenes import scenes

WORLD = load_world()


def test_the_numbers_of_a_scene(world: World) -> None:
    # Own ship heads north at 15 m/s, the goal is 600 m ahead, a ship 300 m to port comes across at 15 m/s.
    state = scenes(load_case("2", world), world, [[0.0, 150.0, math.pi / 2, 0.0]])[0]
    assert float(state[SPEED]) == 15.0
    seen = VectorObservation(world, 2)(state).tolist()
    assert seen[:5] == pytest.approx([450 / 640, 0, 1, 1, 0], abs=1e-6)
    # It passes 212 m astern in 10 s, and its bearing turns counter-clockwise.
    near = [0, 300 / 640, -1, -1, 300 / 640, 1, 0, 10 / 20, 2, 1]
    assert seen[5:15] == pytest.approx(near, abs=1e-6)
    assert seen[15:] == [0.0] * 10


@pytest.mark.parametrize(("most", "step", "left"), [(60, 0, 1.0), (60, 45, 0.25), (100, 20, 1.0)])
def test_own_numbers_end_with_the_time_that_is_left(most: int, step: int, left: float) -> None:
    state = torch.zeros(OWN_SIZE)
    state[STEP] = step
    seen = VectorObservation(replace(WORLD, max_steps=most), 0, encounters=True)(state)
    assert float(seen[-1]) == left and len(seen) == 6


@given(scenarios(), st.floats(-180, 180), st.tuples(st.floats(-300, 300), st.floats(-300, 300)))
def test_only_relative_places_count(scenario: Scenario, degrees: float, shift: tuple[float, float]) -> None:
    observe = VectorObservation(scenario.world, 3)
    moved = moved_case(scenario.case, degrees, shift)
    here, there = (make_env(case, scenario.world).reset()["state"] for case in (scenario.case, moved))
    distances = torch.linalg.vector_norm(relative_positions(here), dim=-1)[is_present(here)].sort()[0]
    # Rounding decides which of two ships at one distance is nearer.
    assume(bool((distances.diff() > 0.1).all()))
    torch.testing.assert_close(observe(here), observe(there), atol=2e-3, rtol=1e-4)


@given(st.permutations(range(4)), st.integers(0, 2**31))
def test_the_nearest_ships_come_first_in_whatever_order_they_are(order: list[int], seed: int) -> None:
    state = torch.rand(state_size(4), generator=torch.Generator().manual_seed(seed)) * 100
    state[SHIP_COUNT] = 4
    ships = state[OWN_SIZE:].view(4, SHIP_SIZE)
    shuffled = torch.cat((state[:OWN_SIZE], ships[order].flatten()))
    observe = VectorObservation(WORLD, 3)
    assert torch.equal(observe(state), observe(shuffled))
    distances = observe(state)[5:].view(3, 10)[:, 4]
    assert distances.tolist() == sorted(distances.tolist())
