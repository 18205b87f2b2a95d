"""The network's picture by supersampling: every shape at many points of every pixel."""

import math

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case

Grid = NDArray[np.float64]
POINTS = 8


def inside(right: Grid, ahead: Grid, corners: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which points lie inside a convex polygon with counter-clockwise corners."""
    hit = np.ones(right.shape, dtype=bool)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        hit &= (bx - ax) * (ahead - ay) - (by - ay) * (right - ax) >= 0
    return hit


def picture(case: Case, world: World, state: list[float]) -> Grid:
    """Return the RGB picture [84, 84, 3] of a state (x, y in m, heading in rad, step), heading up."""
    x, y, heading, step = state
    count = scene.SIZE * POINTS
    axis = ((np.arange(count) + 0.5) / count - 0.5) * 2 * scene.VIEW_RADIUS
    right, ahead = np.meshgrid(axis, -axis)
    radius = np.hypot(right, ahead)

    def here(east: float, north: float) -> tuple[float, float]:
        east, north = east - x, north - y
        return (
            east * math.sin(heading) - north * math.cos(heading),
            east * math.cos(heading) + north * math.sin(heading),
        )

    def ship(middle: tuple[float, float], course: float, length: float) -> NDArray[np.bool_]:
        cos, sin = math.cos(course), math.sin(course)
        corners = [
            (middle[0] + u * cos - v * sin, middle[1] + u * sin + v * cos)
            for u, v in scene.ship_outline(length)
        ]
        return inside(right, ahead, corners)

    goal = here(*case.goal)
    far = math.hypot(*goal)
    along = (right * goal[0] + ahead * goal[1]) / far
    across = (right * goal[1] - ahead * goal[0]) / far
    half = scene.LINE_WIDTH / 2 / scene.PIXELS_PER_METRE
    layers = [
        (radius <= scene.VIEW_RADIUS, scene.DISC),
        (radius <= world.goal_distance, scene.GOAL_CIRCLE),
        (radius <= world.safe_distance, scene.SAFE_CIRCLE),
        (ship((0.0, 0.0), math.pi / 2, scene.OWN_LENGTH), scene.OWN),
        ((along >= 0) & (along <= far) & (abs(across) <= half), scene.LINE),
    ]
    for target in case.target_ships:
        course, time = math.radians(target.heading), step * world.dt
        place = here(
            target.x + target.speed * math.cos(course) * time,
            target.y + target.speed * math.sin(course) * time,
        )
        layers.append((ship(place, course + math.pi / 2 - heading, scene.TARGET_LENGTH), scene.TARGET))
    image = np.empty((count, count, 3))
    image[:] = scene.OUTSIDE
    for where, colour in layers:
        image[where] = colour
    return image.reshape(scene.SIZE, POINTS, scene.SIZE, POINTS, 3).mean((1, 3))
