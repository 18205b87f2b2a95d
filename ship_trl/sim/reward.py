"""The reward of equations 4 to 6, with the paper's weights in `World`. Its formula stands here alone.

torch computes it with tensors (`transition`, `value_bound`), the loop for the CPU below with numbers. The
loop is in this file because numba notices a change of a loop's own file only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32

from ship_trl.config.types import Reward
from ship_trl.jit import RELAXED, compiled

Array = np.ndarray[Any, Any]
# A tensor [...] where torch computes, a number in the compiled loop.
Number = Any

# One millimetre: float32 positions of a straight run end within it of the exact distance.
ROUNDING = 1e-3
# Metres to a target ship, at most: where there is none it is this, as infinity times zero is not a number.
FAR = 1e6


def reward_constants(reward: Reward) -> tuple[float, ...]:
    """Make the constants of `step_reward`; the compiled loop rounds these products to float32."""
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
    """Raw reward of a step (equation 4), in arithmetic that tensors and numbers share: + - * / **, abs, <, >.

    Args:
        constants: those of `reward_constants`.
        distance: metres to the goal after the move.
        off_bow: theta_2 after the move in radians, any sign.
        reached: 1.0 where the goal is within the expected distance (0.0 on a collision), else 0.0.
        collided: 1.0 where a target ship came inside the safe distance, else 0.0.
        nearest: metres to the nearest target ship, the least within the step; `FAR` where there is none.
        speed: the action's speed in m/s.
        turn: the action's rate of turn in rad/s, positive to port.

    Returns:
        The sum of all terms. theta_2 enters in absolute degrees: in radians the two shaping terms
        would be out of balance by a factor of about 60.
    """
    goal, collision, per_metre, per_degree, degrees = constants
    shaping = per_metre * distance + per_degree * abs(off_bow) * degrees
    return shaping + goal * reached + collision * collided


formula = compiled(RELAXED)(step_reward)


@compiled(RELAXED)
def pay(
    action: Array,
    actions: Array,
    constants: tuple[float, ...],
    sight: Array,
    flags: Array,
    apart: Array,
    reward: Array,
) -> None:
    """Write the reward of a step of each of N ships to `reward`.

    Shapes: action, apart, reward [N]; actions [A, 2]; sight float64 [2, N]: distance, off_bow; flags
    [>=2, N]: goal, collision. Other numbers are float32, those of `constants` too.
    """
    for n in range(action.shape[0]):
        speed, turn = actions[action[n]]
        reached, collided = float32(flags[0, n]), float32(flags[1, n])
        distance, nearest = float32(sight[0, n]), min(apart[n], float32(FAR))
        reward[n] = formula(constants, distance, sight[1, n], reached, collided, nearest, speed, turn)
