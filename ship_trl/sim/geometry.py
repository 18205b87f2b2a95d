"""Angles and distances, in radians and metres. Headings are counter-clockwise from east."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def wrap_angle(angle: Tensor) -> Tensor:
    """Wrap angles in radians into [-pi, pi); rounding can return pi itself."""
    return torch.remainder(angle + math.pi, 2 * math.pi) - math.pi


def unit_vector(heading: Tensor) -> Tensor:
    """Return unit vectors [..., 2] that point along headings [...] in radians."""
    return torch.stack((torch.cos(heading), torch.sin(heading)), dim=-1)


def angle_off_bow(position: Tensor, heading: Tensor, point: Tensor) -> Tensor:
    """Return the angles [...] from own ship's heading to the direction of `point` (figure 2).

    The angles are in radians in [-pi, pi), positive to port. For the goal the angle is theta_2, for a
    target ship theta_1.

    Args:
        position: own ship's positions in metres, [..., 2].
        heading: own ship's headings in radians, [...].
        point: positions of the points in metres, [..., 2].
    """
    sight = point - position
    return wrap_angle(torch.atan2(sight[..., 1], sight[..., 0]) - heading)


def closest_approach(start: Tensor, end: Tensor) -> Tensor:
    """Return the least distance [...] from the origin to points that move from `start` to `end`, [..., 2].

    Within a step both ships move on straight lines at constant speed, and so does one relative to the
    other. Their least distance is therefore the distance from the origin to a segment.
    """
    travel = end - start
    length2 = (travel * travel).sum(-1)
    share = -(start * travel).sum(-1) / torch.where(length2 > 0, length2, 1.0)
    nearest = start + share.clamp(0.0, 1.0).unsqueeze(-1) * travel
    return torch.linalg.vector_norm(nearest, dim=-1)


def predicted_approach(position: Tensor, velocity: Tensor) -> tuple[Tensor, Tensor]:
    """Return DCPA (m) and TCPA (s) of points that hold course and speed, [...] each.

    DCPA is the least distance from the origin over all time, TCPA the time until then. TCPA is negative
    if the closest approach is past. A point that does not move has its present distance and 0 s.

    Args:
        position: present positions relative to the origin in metres, [..., 2].
        velocity: velocities relative to the origin in m/s, [..., 2].
    """
    speed2 = (velocity * velocity).sum(-1)
    moving = speed2 > 0
    time = -(position * velocity).sum(-1) / torch.where(moving, speed2, 1.0)
    time = torch.where(moving, time, 0.0)
    return torch.linalg.vector_norm(position + time.unsqueeze(-1) * velocity, dim=-1), time
