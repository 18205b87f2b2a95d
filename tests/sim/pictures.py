"""Pictures to compare with: by supersampling, and by the torch code."""

import math

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser

Grid = NDArray[np.float64]
# Points per pixel along each axis.
POINTS = 8


def compiled_difference(draw: Rasteriser, state: Tensor) -> Tensor:
    """Return the absolute differences of compiled and reference pictures, int32 [N, C, 84 * 84]."""
    return (draw(state).flatten(2).int() - draw.reference(state).int()).abs()


def inside(right: Grid, ahead: Grid, corners: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which points lie inside a convex polygon with counter-clockwise corners."""
    are_inside = np.ones(right.shape, dtype=bool)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        are_inside &= (bx - ax) * (ahead - ay) - (by - ay) * (right - ax) >= 0
    return are_inside


def supersampled(case: Case, world: World, state: list[float]) -> Grid:
    """Return the RGB picture [84, 84, 3] of a state (x, y in m, heading in rad, step), heading up."""
    x, y, heading, step = state
    count = scene.SIZE * POINTS
    axis = ((np.arange(count) + 0.5) / count - 0.5) * 2 * scene.VIEW_RADIUS
    right, ahead = np.meshgrid(axis, -axis)
    radius = np.hypot(right, ahead)

    def to_own_frame(east: float, north: float) -> tuple[float, float]:
        east, north = east - x, north - y
        return (
            east * math.sin(heading) - north * math.cos(heading),
            east * math.cos(heading) + north * math.sin(heading),
        )

    def ship(middle: tuple[float, float], course: float, length: float) -> NDArray[np.bool_]:
        cos, sin = math.cos(course), math.sin(course)
        outline = scene.ship_outline(length)
        corners = [(middle[0] + u * cos - v * sin, middle[1] + u * sin + v * cos) for u, v in outline]
        return inside(right, ahead, corners)

    goal = to_own_frame(*case.goal)
    distance = math.hypot(*goal)
    along = (right * goal[0] + ahead * goal[1]) / distance
    across = (right * goal[1] - ahead * goal[0]) / distance
    half = scene.LINE_WIDTH / 2 / scene.PIXELS_PER_METRE
    layers = [
        (radius <= scene.VIEW_RADIUS, scene.DISC),
        (radius <= world.goal_distance, scene.GOAL_CIRCLE),
        (radius <= world.safe_distance, scene.SAFE_CIRCLE),
        (ship((0.0, 0.0), math.pi / 2, scene.OWN_LENGTH), scene.OWN),
        ((along >= 0) & (along <= distance) & (abs(across) <= half), scene.LINE),
    ]
    for target in case.target_ships:
        course, time = math.radians(target.heading), step * world.dt
        travel = target.speed * time
        middle = to_own_frame(target.x + travel * math.cos(course), target.y + travel * math.sin(course))
        layers.append((ship(middle, course + math.pi / 2 - heading, scene.TARGET_LENGTH), scene.TARGET))
    image = np.empty((count, count, 3))
    image[:] = scene.OUTSIDE
    for where, colour in layers:
        image[where] = colour
    return image.reshape(scene.SIZE, POINTS, scene.SIZE, POINTS, 3).mean((1, 3))
