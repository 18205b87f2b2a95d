"""Angles and distances. Metres and radians; headings counter-clockwise from east."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def wrap_angle(angle: Tensor) -> Tensor:
    """Wrap radians into [-pi, pi); rounding can make it pi itself."""
    return torch.remainder(angle + math.pi, 2 * math.pi) - math.pi


def unit_vector(heading: Tensor) -> Tensor:
    """Direction of a heading: shape [...] to [..., 2]."""
    return torch.stack((torch.cos(heading), torch.sin(heading)), dim=-1)


def angle_off_bow(position: Tensor, heading: Tensor, point: Tensor) -> Tensor:
    """Signed angle from the heading to the line of sight of `point` (figure 2), port positive.

    Shapes: position [..., 2], heading [...], point [..., 2]; returns radians in [-pi, pi).
    Towards `point` is theta_2 for the goal and theta_1 for a target ship.
    """
    sight = point - position
    return wrap_angle(torch.atan2(sight[..., 1], sight[..., 0]) - heading)


def closest_approach(start: Tensor, end: Tensor) -> Tensor:
    """Least distance from the origin of points moving from `start` to `end`: [..., 2] to [...].

    Both ships move on straight lines at steady speed within a step, so their relative position
    does too, and the least distance within the step is that of a segment from the origin.
    """
    travel = end - start
    length2 = (travel * travel).sum(-1)
    share = -(start * travel).sum(-1) / torch.where(length2 > 0, length2, 1.0)
    nearest = start + share.clamp(0.0, 1.0).unsqueeze(-1) * travel
    return torch.linalg.vector_norm(nearest, dim=-1)


def predicted_approach(away: Tensor, velocity: Tensor) -> tuple[Tensor, Tensor]:
    """Compute DCPA (m) and TCPA (s) of points that hold their course and speed: [..., 2] to [...] each.

    Args:
        away: where they are now, relative to the origin, in metres.
        velocity: how they move relative to it, in m/s.

    Returns:
        The least distance from the origin over all time, and when that is; negative where it has passed.
        A point that does not move has its distance now, and 0 s.
    """
    speed2 = (velocity * velocity).sum(-1)
    moving = speed2 > 0
    time = -(away * velocity).sum(-1) / torch.where(moving, speed2, 1.0)
    time = torch.where(moving, time, 0.0)
    return torch.linalg.vector_norm(away + time.unsqueeze(-1) * velocity, dim=-1), time
