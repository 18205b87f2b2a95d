"""The scene as people see it: the network's picture drawn large with pygame, no window needed.

Sizes, colours and order of drawing are those of `sim/scene.py` and the rasteriser; a test compares
the two pictures. The drawing itself shares no code with the rasteriser's, so that each checks the
other.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import HEADING
from ship_trl.sim.transition import Transition

# A library does not greet on standard output.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

# Each pixel is averaged from this many squared: pygame's own polygons have hard edges.
OVERSAMPLING = 4
TRACK_RADIUS = 5.0
# How much of a ship's colour its past track has; the rest is water.
TRACK_INK = 0.55

Points = list[tuple[float, float]]


class Chart:
    """Own-ship-centred, heading-up projection: metres east and north to pixels right and down.

    Args:
        own: x, y (m) and heading (rad) of own ship.
        size: width and height of the picture in pixels; it shows 2 x `scene.WINDOW` metres.
    """

    def __init__(self, own: Sequence[float], size: int) -> None:
        self.x, self.y, heading = own[:3]
        self.middle = size / 2
        self.scale = size / (2 * scene.WINDOW)
        self.turn = math.pi / 2 - heading
        self._cos, self._sin = math.cos(self.turn), math.sin(self.turn)

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of a place (m)."""
        east, north = x - self.x, y - self.y
        right = east * self._cos - north * self._sin
        ahead = east * self._sin + north * self._cos
        return self.middle + right * self.scale, self.middle - ahead * self.scale

    def outline(self, x: float, y: float, heading: float, length: float) -> Points:
        """Pixels of the corners of a ship (m, rad)."""
        cos, sin = math.cos(heading), math.sin(heading)
        corners = scene.ship_outline(length)
        return [self.point(x + u * cos - v * sin, y + u * sin + v * cos) for u, v in corners]


def draw_scene(
    case: Case,
    world: World,
    state: Tensor | Sequence[float],
    size: int = 600,
    tracks: Tensor | None = None,
) -> pygame.Surface:
    """Draw one state large.

    Args:
        case: where the ships and the goal are.
        world: safe and expected distance.
        state: x, y (m), heading (rad), step; four numbers.
        size: pixels on a side.
        tracks: float [N, 4], states sailed before; each leaves a faint dot for every ship. The
            network sees no tracks.

    Returns:
        A surface of `size` x `size`, 32 bits; no display is opened.

    Raises:
        ValueError: `state` has not four numbers.
    """
    own = [float(value) for value in state]
    if len(own) != 4:
        raise ValueError(f"state must be x, y, heading, step; got {len(own)} numbers")
    chart = Chart(own, size * OVERSAMPLING)
    motion = Transition(case, world, torch.device("cpu"))
    picture = pygame.Surface((size * OVERSAMPLING,) * 2, depth=32)
    picture.fill(scene.OUTSIDE)
    middle = (chart.middle, chart.middle)
    for radius, colour in (
        (scene.WINDOW, scene.DISC),
        (world.goal_distance, scene.GOAL_CIRCLE),
        (world.safe_distance, scene.SAFE_CIRCLE),
    ):
        pygame.draw.circle(picture, colour, middle, radius * chart.scale)
    if tracks is not None:
        _draw_tracks(picture, chart, motion, tracks)
    pygame.draw.polygon(picture, scene.OWN, chart.outline(own[0], own[1], own[HEADING], scene.OWN_LENGTH))
    pygame.draw.polygon(picture, scene.LINE, _line(chart, case.goal))
    places = motion.away(torch.tensor([own]))[0] + torch.tensor(own[:2])
    for ship, (x, y) in zip(case.target_ships, places.tolist(), strict=True):
        corners = chart.outline(x, y, math.radians(ship.heading), scene.TARGET_LENGTH)
        pygame.draw.polygon(picture, scene.TARGET, corners)
    return pygame.transform.smoothscale(picture, (size, size))


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """Copy the pixels of a surface: uint8 [H, W, 3], RGB."""
    raw = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
    return raw.reshape(surface.get_height(), surface.get_width(), 3).copy()


def _line(chart: Chart, goal: Sequence[float]) -> Points:
    """Draw the line from own ship to the goal as a strip; its length is the goal's distance."""
    (x1, y1), (x2, y2) = (chart.middle, chart.middle), chart.point(goal[0], goal[1])
    length = math.hypot(x2 - x1, y2 - y1) or 1.0
    # The width is given in the network's pixels.
    half = 0.5 * scene.LINE_WIDTH / scene.PIXELS_PER_METRE * chart.scale
    right, down = half * (y1 - y2) / length, half * (x2 - x1) / length
    sides = ((x1, y1, 1), (x2, y2, 1), (x2, y2, -1), (x1, y1, -1))
    return [(x + side * right, y + side * down) for x, y, side in sides]


def _draw_tracks(picture: pygame.Surface, chart: Chart, motion: Transition, tracks: Tensor) -> None:
    own = tracks[:, :2]
    ships = motion.away(tracks) + own[:, None]
    radius = TRACK_RADIUS * chart.scale
    for places, colour in ((ships.flatten(0, 1), scene.TARGET), (own, scene.OWN)):
        faint = pygame.Color(*scene.DISC).lerp(pygame.Color(*colour), TRACK_INK)
        for x, y in places.tolist():
            pygame.draw.circle(picture, faint, chart.point(x, y), radius)
