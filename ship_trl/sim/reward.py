"""The reward (equations 4 to 6) as a sum of named terms. A formula is written only here.

torch evaluates the terms with tensors (`transition`, `planner`), and a compiled loop with numbers
(`fast.step.write_rewards`). Only operations that both share are allowed: + - * / **, abs, < and >.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from ship_trl.config.types import Reward

# A tensor [...] in torch, a number in the compiled loop.
Number = Any

# Metres. After a straight run, float32 positions are within this distance of the exact ones.
POSITION_TOLERANCE = 1e-3
# Metres. Stands for the nearest ship's distance if there is none: infinity times zero is not a number.
MAX_SHIP_DISTANCE = 1e6
# A Python float would turn the compiled loop's products into float64.
DEGREES = np.float32(180.0 / math.pi)


class PaidStep(NamedTuple):
    """What steps are paid for.

    Attributes:
        distance: distance to the goal after the move, in metres.
        off_bow: theta_2 after the move in radians, of either sign.
        reached: 1.0 if the goal is reached and no collision happens, else 0.0.
        collided: 1.0 if a target ship comes inside the safe distance, else 0.0.
        nearest: least distance to any target ship within the step, in metres; at most `MAX_SHIP_DISTANCE`.
        speed: speed of the action in m/s.
        turn: rate of turn of the action in rad/s, positive to port.
    """

    distance: Number
    off_bow: Number
    reached: Number
    collided: Number
    nearest: Number
    speed: Number
    turn: Number


class Term(NamedTuple):
    """A term: its constant in a world's reward, and its formula of this `amount` and a `PaidStep`."""

    amount: Callable[[Reward], float]
    formula: Callable[[Number, PaidStep], Number]


# Added in this order. theta_2 enters in absolute degrees: in radians its term would be about 60 times too
# small beside the distance.
TERMS = {
    "distance": Term(lambda reward: reward.w3 * reward.k1, lambda amount, step: amount * step.distance),
    "deviation": Term(
        lambda reward: reward.w4 * reward.k2, lambda amount, step: amount * abs(step.off_bow) * DEGREES
    ),
    "goal": Term(lambda reward: reward.w1 * reward.goal, lambda amount, step: amount * step.reached),
    "collision": Term(
        lambda reward: reward.w2 * reward.collision, lambda amount, step: amount * step.collided
    ),
}


def reward_amounts(reward: Reward) -> tuple[float, ...]:
    """Return the amount of each of `TERMS`; the compiled loop rounds them to float32."""
    return tuple(term.amount(reward) for term in TERMS.values())


def reward_terms(amounts: tuple[float, ...], step: PaidStep) -> dict[str, Number]:
    """Return the raw reward of steps by term, for what `reward_amounts` returns."""
    terms = zip(TERMS.items(), amounts, strict=True)
    return {name: term.formula(amount, step) for (name, term), amount in terms}


def step_reward(amounts: tuple[float, ...], step: PaidStep) -> Number:
    """Return the raw reward of steps (equation 4): the sum of all terms."""
    return reduce(add, reward_terms(amounts, step).values())
