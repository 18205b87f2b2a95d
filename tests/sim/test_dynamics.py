"""The motion of table 1, action by action."""

import math
from dataclasses import replace

import pytest
import torch

from ship_trl.config.types import World
from ship_trl.sim.cases import load_case
from ship_trl.sim.state import (
    GOAL_X,
    GOAL_Y,
    HEADING,
    SPEED,
    STEP,
    YAW_RATE,
    X,
    Y,
    initial_state,
)
from ship_trl.sim.transition import Transition, advance
from tests.sim.scenes import scenes

TABLE_1 = [(7.5, 0.1), (12, 0.02), (12, 0.01), (15, 0), (12, -0.01), (12, -0.02), (7.5, -0.1)]


def test_the_actions_are_those_of_table_1(world: World) -> None:
    assert [tuple(action) for action in world.actions] == TABLE_1


@pytest.mark.parametrize("action", range(7))
def test_an_action_turns_and_then_moves(world: World, action: int) -> None:
    speed, turn = TABLE_1[action]
    state = scenes(load_case("1", world), world, [[10.0, -20.0, math.pi / 2, 4.0]])[0]
    after = advance(state, torch.tensor(action), torch.tensor(world.actions), 1.0)
    x, y, heading, step = after[[X, Y, HEADING, STEP]].tolist()
    assert after[[SPEED, YAW_RATE]].tolist() == pytest.approx([speed, turn])
    assert after[[GOAL_X, GOAL_Y]].tolist() == [0.0, 600.0]
    assert heading == pytest.approx(math.pi / 2 + turn)
    assert x == pytest.approx(10 + speed * math.cos(heading), abs=1e-4)
    assert y == pytest.approx(-20 + speed * math.sin(heading), abs=1e-4)
    assert step == 5.0
    # a1 to a3 turn to port: west of a ship that heads north.
    assert (x < 10 - 1e-3) == (turn > 0)


def lagging(world: World, turn_time: float, speed_time: float, dt: float = 1.0) -> World:
    return replace(world, turn_time=turn_time, speed_time=speed_time, dt=dt)


@pytest.mark.parametrize("dt", [0.5, 1.0, 2.0])
def test_speed_and_rate_of_turn_cover_63_percent_of_their_way_in_the_time_constant(
    world: World, dt: float
) -> None:
    slow, states = lagging(world, 4.0, 8.0, dt), []
    state = initial_state(load_case("1", world), world)
    for _ in range(round(8 / dt)):
        state = Transition(slow)(state[None], torch.tensor([0])).state[0]
        states.append(state)
    assert float(states[round(4 / dt) - 1][YAW_RATE]) == pytest.approx(0.1 * (1 - 1 / math.e), rel=1e-5)
    assert float(state[SPEED]) == pytest.approx(15 - 7.5 * (1 - 1 / math.e), rel=1e-5)


def test_turn_and_way_with_lags_are_the_integrals_over_the_step(world: World) -> None:
    state = initial_state(load_case("1", world), world)
    state[[HEADING, SPEED, YAW_RATE]] = torch.tensor([0.0, 9.0, -0.04])
    after = Transition(lagging(world, 3.0, 5.0, 2.0))(state[None], torch.tensor([0])).state[0]
    moments = (torch.arange(10_000, dtype=torch.float64) + 0.5) / 5000
    heading = float((0.1 - 0.14 * torch.exp(-moments / 3)).mean() * 2)
    way = float((7.5 + 1.5 * torch.exp(-moments / 5)).mean() * 2)
    assert float(after[HEADING]) == pytest.approx(heading, abs=1e-6)
    # Own ship turns first, then moves.
    expected = [way * math.cos(heading), way * math.sin(heading)]
    assert after[[X, Y]].tolist() == pytest.approx(expected, abs=1e-4)
