"""The motion of table 1, action by action."""

import math

import pytest
import torch

from ship_trl.config.types import World
from ship_trl.sim.dynamics import advance, target_positions

TABLE_1 = [(7.5, 0.1), (12, 0.02), (12, 0.01), (15, 0), (12, -0.01), (12, -0.02), (7.5, -0.1)]


def test_the_actions_are_those_of_table_1(world: World) -> None:
    assert [tuple(action) for action in world.actions] == TABLE_1


@pytest.mark.parametrize("action", range(7))
def test_an_action_turns_and_then_moves(world: World, action: int) -> None:
    speed, turn = TABLE_1[action]
    state = torch.tensor([10.0, -20.0, math.pi / 2, 4.0])
    x, y, heading, step = advance(state, torch.tensor(action), torch.tensor(world.actions), 1.0).tolist()
    assert heading == pytest.approx(math.pi / 2 + turn)
    assert x == pytest.approx(10 + speed * math.cos(heading), abs=1e-4)
    assert y == pytest.approx(-20 + speed * math.sin(heading), abs=1e-4)
    assert step == 5.0
    # a1 to a3 turn to port: west of a ship that heads north.
    assert (x < 10 - 1e-3) == (turn > 0)


def test_the_step_length_scales_turn_and_way(world: World) -> None:
    state = torch.tensor([0.0, 0.0, 0.0, 0.0])
    x, y, heading, step = advance(state, torch.tensor(0), torch.tensor(world.actions), 0.5).tolist()
    assert heading == pytest.approx(0.05) and math.hypot(x, y) == pytest.approx(3.75) and step == 1.0


def test_target_ships_hold_course_and_speed() -> None:
    start = torch.tensor([[100.0, 0.0], [0.0, 50.0]])
    velocity = torch.tensor([[-15.0, 0.0], [3.0, 4.0]])
    state = torch.zeros(2, 4)
    state[:, 3] = torch.tensor([0.0, 20.0])
    places = target_positions(state, start, velocity, 0.5)
    torch.testing.assert_close(places[0], start)
    # A target ship does not stop at own ship's start.
    torch.testing.assert_close(places[1], torch.tensor([[-50.0, 0.0], [30.0, 90.0]]))
