"""The compiled numbers of a scene equal those of torch, to the rounding of float32."""

from __future__ import annotations

import math
from functools import partial

import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from ship_trl.fast.observe import CompiledVector
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.encounter import own_velocity, ship_velocities
from ship_trl.sim.state import (
    HEADING,
    OWN_SIZE,
    SHIP_CLASS,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SIZE,
    SHIP_SPEED,
    SPEED,
    STEP,
    initial_state,
    relative_positions,
    target_ships,
)
from ship_trl.sim.vector import VectorObservation

WORLD = load_world()
# Metres, radians, m/s, rad/s, metres of the goal, steps and ships; then metres, radians, m/s and behaviour.
LARGEST = [800.0, 800.0, 2 * math.pi, 15.0, 0.1, 800.0, 800.0, 0.0, 0.0]
SHIP_LARGEST = [800.0, 800.0, 2 * math.pi, 20.0, 0.0, 0.1, 0.0, 60.0, 2 * math.pi, 1.0]


@given(st.integers(0, 8), st.integers(0, 8), st.integers(1, 9), st.booleans(), st.integers(0, 2**31))
def test_numbers_are_those_of_torch(ships: int, empty: int, shown: int, encounters: bool, seed: int) -> None:
    largest = torch.tensor(LARGEST + SHIP_LARGEST * (ships + empty))
    states = (2 * torch.rand(20, len(largest), generator=torch.Generator().manual_seed(seed)) - 1) * largest
    states[:, SHIP_COUNT], states[:, STEP] = ships, torch.arange(20.0) * 4
    target_ships(states)[..., SHIP_SPEED].abs_()
    kinds = torch.randint(6, (20, ships + empty), generator=torch.Generator().manual_seed(seed))
    target_ships(states)[..., SHIP_CLASS] = kinds.float()
    # Rounding decides which of two ships at one distance is nearer, and when a ship that moves alike is near.
    distances = torch.linalg.vector_norm(relative_positions(states)[:, :ships], dim=-1).sort()[0]
    velocities = (ship_velocities(states) - own_velocity(states)[:, None])[:, :ships]
    clear = torch.linalg.vector_norm(velocities, dim=-1) > 1
    states = states[(distances.diff() > 1e-3).all(-1) & clear.all(-1)]
    assume(len(states))
    observe = VectorObservation(WORLD, shown, encounters)
    found, wanted = CompiledVector(observe)(states), observe(states)
    assert found.shape == wanted.shape and found.dtype == wanted.dtype
    of_ships, wanted_of_ships = (
        seen[:, 5 + encounters :].unflatten(-1, (shown, 10 + 9 * encounters)) for seen in (found, wanted)
    )
    approach, others = [7, 8], [0, 1, 2, 3, 4, 5, 6, *range(9, 10 + 9 * encounters)]
    near = partial(torch.testing.assert_close, rtol=1e-6, atol=2e-6)
    near(found[:, : 5 + encounters], wanted[:, : 5 + encounters])
    near(of_ships[..., others], wanted_of_ships[..., others])
    # An error of velocity counts as often as the distance is larger than the way of a second.
    torch.testing.assert_close(of_ships[..., approach], wanted_of_ships[..., approach], rtol=0, atol=3e-4)


@given(st.floats(-7, 7), st.floats(0, 15))
def test_a_ship_with_own_ships_velocity_does_not_approach(heading: float, speed: float) -> None:
    state = initial_state(load_case("4", WORLD), WORLD)[None].clone()
    state[:, [HEADING, OWN_SIZE + SHIP_HEADING]], state[:, [SPEED, OWN_SIZE + SHIP_SPEED]] = heading, speed
    seen = CompiledVector(VectorObservation(WORLD, 1))(state)
    assert seen[0, [7, 8, 12, 13]].tolist() == [0, 0, 0, 0]


def test_at_the_goal_and_on_a_ship_numbers_are_finite() -> None:
    observe, states = VectorObservation(WORLD, 2), torch.zeros(1, OWN_SIZE + 2 * SHIP_SIZE)
    states[:, [SHIP_COUNT, STEP]] = 2.0
    found = CompiledVector(observe)(states)
    torch.testing.assert_close(found, observe(states), rtol=0, atol=1e-6)
