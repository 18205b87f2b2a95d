"""Equations 4 to 6, compared with plain Python."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.config.types import Reward
from ship_trl.sim.cases import load_world
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, TERMS, PaidStep, reward_amounts, reward_terms, step_reward

WEIGHTS = load_world().reward
# No ship, full speed ahead.
ALONE = MAX_SHIP_DISTANCE, 15.0, 0.0
distances = st.floats(0.0, 2000.0)
thetas = st.floats(-math.pi, math.pi)


def reward(distance: float, theta: float, reached: bool, collided: bool) -> float:
    values = torch.tensor([distance, theta, reached, collided, *ALONE], dtype=torch.float64)
    return float(step_reward(reward_amounts(WEIGHTS), PaidStep(*values)))


@given(distances, thetas, st.booleans(), st.booleans())
def test_every_term_that_applies_is_added(
    distance: float, theta: float, reached: bool, collided: bool
) -> None:
    by_hand = (200.0 if reached else 0.0) - (200.0 if collided else 0.0)
    by_hand += 0.01 * -1.0 * distance + 0.01 * -5.0 * abs(math.degrees(theta))
    assert reward(distance, theta, reached, collided) == pytest.approx(by_hand, abs=1e-6)


def test_every_weight_is_used_where_it_belongs() -> None:
    weights = Reward(goal=2, collision=-3, w1=5, w2=7, w3=11, w4=13, k1=-17, k2=-19)
    distance, theta = torch.tensor([23.0] * 3), torch.deg2rad(torch.tensor([29.0] * 3))
    reached, collided = torch.tensor([0.0, 1.0, 0.0]), torch.tensor([0.0, 0.0, 1.0])
    shaping = 11 * -17 * 23 + 13 * -19 * 29
    step, amounts = PaidStep(distance, theta, reached, collided, *ALONE), reward_amounts(weights)
    rewards = step_reward(amounts, step).tolist()
    assert rewards == pytest.approx([shaping, shaping + 5 * 2, shaping + 7 * -3])
    terms = reward_terms(amounts, step)
    assert list(terms) == list(TERMS) and terms["collision"].tolist() == [0, 0, 7 * -3]


@given(distances, thetas)
def test_port_and_starboard_cost_the_same(distance: float, theta: float) -> None:
    assert reward(distance, theta, False, False) == reward(distance, -theta, False, False)


@given(st.floats(-20.0, 20.0), st.floats(-math.pi, math.pi))
def test_no_angle_counts_more_than_half_a_turn(heading: float, sight: float) -> None:
    goal = torch.tensor([math.cos(sight), math.sin(sight)], dtype=torch.float64) * 100
    off = angle_off_bow(torch.zeros(2, dtype=torch.float64), torch.tensor(heading, dtype=torch.float64), goal)
    degrees = abs(math.degrees(math.remainder(sight - heading, 2 * math.pi)))
    assert 0 <= degrees <= 180
    assert reward(0.0, float(off), False, False) == pytest.approx(-0.05 * degrees, abs=1e-6)
