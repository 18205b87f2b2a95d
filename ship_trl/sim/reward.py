"""The reward (equations 4 to 6), with the paper's weights from `World`. The formula is written only here.

torch evaluates `step_reward` with tensors (`transition`, `value_bound`), and `write_rewards` with numbers in
a loop that `fast.step_kernel` compiles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ship_trl.config.types import Reward

Array = np.ndarray[Any, Any]
# A tensor [...] in torch, a number in the compiled loop.
Number = Any

# Metres. After a straight run, float32 positions are within this distance of the exact ones.
POSITION_TOLERANCE = 1e-3
# Metres. Stands for the nearest ship's distance if there is none: infinity times zero is not a number.
MAX_SHIP_DISTANCE = 1e6


def reward_constants(reward: Reward) -> tuple[float, ...]:
    """Return the constants of `step_reward`; the compiled loop rounds them to float32."""
    return (
        reward.w1 * reward.goal,
        reward.w2 * reward.collision,
        reward.w3 * reward.k1,
        reward.w4 * reward.k2,
        180.0 / math.pi,
    )


def step_reward(
    constants: tuple[Number, ...],
    distance: Number,
    off_bow: Number,
    reached: Number,
    collided: Number,
    nearest: Number,
    speed: Number,
    turn: Number,
) -> Number:
    """Return the raw reward of a step (equation 4): the sum of all terms.

    Only operations that tensors and numbers share are allowed: + - * / **, abs, < and >. theta_2 enters in
    absolute degrees: in radians its term would be about 60 times too small beside the distance term.

    Args:
        constants: what `reward_constants` returns.
        distance: distance to the goal after the move, in metres.
        off_bow: theta_2 after the move in radians, of either sign.
        reached: 1.0 if the goal is reached and no collision happens, else 0.0.
        collided: 1.0 if a target ship comes inside the safe distance, else 0.0.
        nearest: least distance to any target ship within the step, in metres; at most `MAX_SHIP_DISTANCE`.
        speed: speed of the action in m/s.
        turn: rate of turn of the action in rad/s, positive to port.
    """
    goal, collision, per_metre, per_degree, degrees = constants
    shaping = per_metre * distance + per_degree * abs(off_bow) * degrees
    return shaping + goal * reached + collision * collided


def write_rewards(
    action: Array,
    actions: Array,
    constants: tuple[float, ...],
    to_goal: Array,
    flags: Array,
    min_distance: Array,
    reward: Array,
) -> None:
    """Write the rewards of one step of N ships into `reward`, float32 [N].

    Shapes: action int64 [N]; actions float32 [A, 2] (m/s, rad/s); constants as in `step_reward`, float32;
    to_goal float64 [2, N]: distance (m) and angle off the bow (rad); flags bool [>=2, N]: goal, collision;
    min_distance float32 [N]: least distance to any target ship within the step (m).
    """
    for n in range(action.shape[0]):
        speed, turn = actions[action[n]]
        reached, collided = np.float32(flags[0, n]), np.float32(flags[1, n])
        distance, nearest = np.float32(to_goal[0, n]), min(min_distance[n], np.float32(MAX_SHIP_DISTANCE))
        reward[n] = step_reward(constants, distance, to_goal[1, n], reached, collided, nearest, speed, turn)
