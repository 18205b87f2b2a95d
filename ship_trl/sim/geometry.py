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

    Angles are in radians in [-pi, pi), positive to port: theta_2 for the goal, theta_1 for a target ship.
    Shapes: position, point [..., 2] in metres; heading [...] in radians.
    """
    offset = point - position
    return wrap_angle(torch.atan2(offset[..., 1], offset[..., 0]) - heading)


def nearest_points(start: Tensor, end: Tensor) -> Tensor:
    """Return where points that move from `start` to `end` are nearest to the origin; all are [..., 2].

    Points are positions of one ship relative to another. Within a step both ships keep course and speed, so
    the relative motion is a straight segment.
    """
    travel = end - start
    length2 = (travel * travel).sum(-1)
    # `masked_fill`, because `torch.where` would copy a number to the device.
    share = -(start * travel).sum(-1) / length2.masked_fill(~(length2 > 0), 1.0)
    return start + share.clamp(0.0, 1.0).unsqueeze(-1) * travel


def closest_approach(start: Tensor, end: Tensor) -> Tensor:
    """Return the least distance [...] from the origin to points that move from `start` to `end`, [..., 2]."""
    return torch.linalg.vector_norm(nearest_points(start, end), dim=-1)


def polygon_edges(corners: Tensor) -> list[tuple[float, float, float]]:
    """Return each edge's outward normal (x, y) and its distance from the origin, for corners [E, 2].

    The corners must be in counter-clockwise order.
    """
    edges = []
    for (ax, ay), (bx, by) in zip(corners.tolist(), corners.roll(-1, 0).tolist(), strict=True):
        length = math.hypot(bx - ax, by - ay)
        normal_x, normal_y = (by - ay) / length, (ax - bx) / length
        edges.append((normal_x, normal_y, normal_x * ax + normal_y * ay))
    return edges


def predicted_approach(position: Tensor, velocity: Tensor) -> tuple[Tensor, Tensor]:
    """Return DCPA (m) and TCPA (s), both [...], of points that keep course and speed relative to the origin.

    DCPA is the least distance from the origin over all time. TCPA is the time until then, negative if it has
    passed. A point at rest has its present distance and 0 s.
    Shapes: position [..., 2] in metres, velocity [..., 2] in m/s.
    """
    speed2 = (velocity * velocity).sum(-1)
    at_rest = ~(speed2 > 0)
    time = -(position * velocity).sum(-1) / speed2.masked_fill(at_rest, 1.0)
    time = time.masked_fill(at_rest, 0.0)
    return torch.linalg.vector_norm(position + time.unsqueeze(-1) * velocity, dim=-1), time
