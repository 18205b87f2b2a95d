"""The reward of equations 4 to 6, with the paper's weights in `World`."""

from __future__ import annotations

import math

from torch import Tensor

from ship_trl.config import Reward

# One millimetre: float32 positions of a straight run end within it of the exact distance.
ROUNDING = 1e-3


def step_reward(
    weights: Reward, goal_distance: Tensor, off_bow: Tensor, reached: Tensor, collided: Tensor
) -> Tensor:
    """Raw reward of a step, every term measured after the move (equation 4).

    Args:
        weights: constants of equations 4 to 6.
        goal_distance: metres to the goal, [...].
        off_bow: theta_2 in radians, any sign, [...].
        reached: the goal is within the expected distance (already false on a collision), [...].
        collided: a target ship came inside the safe distance, [...].

    Returns:
        float tensor [...]. theta_2 enters in absolute degrees: in radians the two shaping terms
        would be out of balance by a factor of about 60.
    """
    degrees = off_bow.abs() * (180.0 / math.pi)
    return (
        weights.w1 * weights.goal * reached.to(goal_distance.dtype)
        + weights.w2 * weights.collision * collided.to(goal_distance.dtype)
        + weights.w3 * weights.k1 * goal_distance
        + weights.w4 * weights.k2 * degrees
    )
