"""Paint scenes: own ship in the middle and heading up (figure 2b), or north up (figure 2a).

Sizes, colours and the order of drawing are those of the network's rasteriser, but no code is shared: a test
compares the two pictures, so each checks the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pygame
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.state import GOAL_X, GOAL_Y, HEADING, SPEED, X, Y
from ship_trl.view import pen
from ship_trl.view.palette import BACKGROUND, OUTCOMES, TEXT, Colour, blend
from ship_trl.view.pen import Point
from ship_trl.view.telemetry import Numbers, Telemetry, measure

# Metres.
RINGS = (200.0, 400.0, 600.0)
# The paper gives no length: a coaster, whose bow stays inside the safe distance.
TRUE_LENGTH = 25.0
GRID = blend(scene.OUTSIDE, scene.DISC, 0.22)
SHIP_TRACK, OWN_TRACK = blend(scene.TARGET, scene.DISC, 0.6), blend(scene.OWN, scene.DISC, 0.7)
# Metres around everything in the absolute frame, and the step to which its width is rounded up.
MARGIN, WIDTH_STEP = 90.0, 100.0
# Metres: a longer speed vector is cut, outside the picture.
MAX_VECTOR = 4 * scene.VIEW_RADIUS
# Metres between the lines of a grid, or of a scale bar.
LENGTHS = (50, 100, 200, 500, 1000, 2000, 5000, 10**4, 10**5)


@dataclass(frozen=True)
class Projection:
    """Converts metres to pixels: (x, y) is in the middle, and the direction `up` (rad) points up."""

    x: float
    y: float
    up: float
    side: int
    scale: float

    def points(self, places: Numbers) -> Numbers:
        """Convert places [..., 2] in metres to pixels [..., 2]."""
        east, north = places[..., 0] - self.x, places[..., 1] - self.y
        cos, sin = math.cos(math.pi / 2 - self.up), math.sin(math.pi / 2 - self.up)
        right, ahead = east * cos - north * sin, east * sin + north * cos
        return np.stack((self.side / 2 + right * self.scale, self.side / 2 - ahead * self.scale), -1)

    def point(self, x: float, y: float) -> Point:
        """Convert one place."""
        right, down = self.points(np.array([x, y])).tolist()
        return right, down

    def hull(self, pose: Numbers, length: float) -> list[Point]:
        """Return the corners of a ship in pixels; `pose` is x, y (m) and heading (rad)."""
        cos, sin = math.cos(pose[HEADING]), math.sin(pose[HEADING])
        corners = np.array(scene.ship_outline(length)) @ np.array([[cos, sin], [-sin, cos]]) + pose[[X, Y]]
        return [(right, down) for right, down in self.points(corners).tolist()]


def relative_frame(own: Numbers, side: int) -> Projection:
    """Return the network's projection: own ship (x, y, heading) in the middle, its bow up."""
    return Projection(float(own[X]), float(own[Y]), float(own[HEADING]), side, side / (2 * scene.VIEW_RADIUS))


def absolute_frame(telemetries: Sequence[Telemetry], side: int) -> Projection:
    """Return a north-up projection that shows start, goal, the target ships' starts and all own tracks."""
    first = telemetries[0].states[:1]
    places = [first[:, [X, Y]], first[:, [GOAL_X, GOAL_Y]], telemetries[0].ships[0]]
    places += [telemetry.states[:, [X, Y]] for telemetry in telemetries]
    low, high = np.concatenate(places).min(0), np.concatenate(places).max(0)
    # Rounded, so that a growing episode seldom changes the scale.
    width = WIDTH_STEP * math.ceil((float((high - low).max()) + 2 * MARGIN) / WIDTH_STEP)
    x, y = ((low + high) / 2).tolist()
    return Projection(x, y, math.pi / 2, side, side / width)


def draw_scene(
    case: Case, world: World, state: Tensor, size: int = 600, vector_time: float = 0.0
) -> pygame.Surface:
    """Draw one state [S] as the network sees it, as a square of `size` pixels."""
    picture = pen.new_surface(size, size)
    telemetry = measure(case, world, state[None], torch.zeros(0, dtype=torch.int64))
    paint_scene(picture, telemetry, 0.0, plain=True, vector_time=vector_time)
    return picture


def paint_scene(
    picture: pygame.Surface,
    telemetry: Telemetry,
    position: float,
    absolute: Projection | None = None,
    to_scale: bool = False,
    plain: bool = False,
    vector_time: float = 0.0,
) -> None:
    """Fill a square surface with the scene at a position in steps.

    By default own ship stays in the middle; in the projection `absolute` all ships move. With `to_scale` true
    hulls are drawn inside the outlines that the network sees. A `plain` picture has only what the network
    sees: no tracks, numbers, scale and north arrow. Speed vectors show the way of `vector_time` seconds.
    """
    world, side = telemetry.world, picture.get_width()
    own, ships = telemetry.at(position)
    frame = absolute or relative_frame(own, side)
    distances = ((world.goal_distance, scene.GOAL_CIRCLE), (world.safe_distance, scene.SAFE_CIRCLE))
    picture.blit(_grid(frame) if absolute else _disc(side, distances, plain), (0, 0))
    middle = frame.point(*own[:2])
    if absolute:
        _draw_places(picture, telemetry, frame)
        for radius, colour in distances:
            pen.circle(picture, colour, middle, radius * frame.scale)
    if not plain:
        _draw_tracks(picture, telemetry, math.ceil(position), frame)
    _draw_hull(picture, frame, own, scene.OWN, scene.OWN_LENGTH, to_scale)
    width = scene.LINE_WIDTH * side / scene.SIZE if plain else max(2, side // 220)
    pen.strip(picture, scene.LINE, middle, frame.point(*telemetry.states[0, [GOAL_X, GOAL_Y]]), width)
    step = min(int(position), telemetry.steps)
    headings = telemetry.headings[step]
    if vector_time:
        # People tell own ship's vector from the line to the goal by its width.
        own_width = width if plain else 2 * width
        way = telemetry.states[step, SPEED] * vector_time
        _draw_vector(picture, frame, own, way, scene.OWN_LENGTH, scene.OWN, own_width)
        ways = telemetry.speeds[step] * vector_time
        for place, heading, way in zip(ships, headings, ways, strict=True):
            pose = np.array([*place, heading])
            _draw_vector(picture, frame, pose, way, scene.TARGET_LENGTH, scene.TARGET, width)
    for k, (place, heading) in enumerate(zip(ships, headings, strict=True), 1):
        pose = np.array([*place, heading])
        _draw_hull(picture, frame, pose, scene.TARGET, scene.TARGET_LENGTH, to_scale)
        if not plain:
            _draw_number(picture, frame, pose, k)
    if not plain:
        _draw_north(picture, frame)
        _draw_scale(picture, frame)
        if telemetry.outcome and position >= telemetry.steps:
            _draw_outcome(picture, telemetry.outcome)


@lru_cache(4)
def _disc(side: int, distances: tuple[tuple[float, Colour], ...], plain: bool) -> pygame.Surface:
    """Draw what never moves in the relative frame; unless it is `plain`, add rings of distance."""
    picture = pen.new_surface(side, side)
    picture.fill(scene.OUTSIDE)
    middle, scale = (side / 2, side / 2), side / (2 * scene.VIEW_RADIUS)
    pen.circle(picture, scene.DISC, middle, scene.VIEW_RADIUS * scale)
    for radius in () if plain else RINGS:
        pen.circle(picture, GRID, middle, radius * scale, 1)
    for radius, colour in distances:
        pen.circle(picture, colour, middle, radius * scale)
    return picture


@lru_cache(4)
def _grid(frame: Projection) -> pygame.Surface:
    """Draw what never moves in the absolute frame: water with a grid."""
    side = frame.side
    picture = pen.new_surface(side, side)
    picture.fill(scene.DISC)
    half = side / frame.scale / 2
    step = next((step for step in LENGTHS if half / step < 6), 10**9)
    for x in range(math.ceil((frame.x - half) / step) * step, math.ceil(frame.x + half), step):
        right = frame.point(x, 0)[0]
        pygame.draw.aaline(picture, GRID, (right, 0), (right, side))
    for y in range(math.ceil((frame.y - half) / step) * step, math.ceil(frame.y + half), step):
        down = frame.point(0, y)[1]
        pygame.draw.aaline(picture, GRID, (0, down), (side, down))
    return picture


def text_size(side: int, at_900: int) -> int:
    """Scale a size of letters to a picture of `side` pixels."""
    return max(12, round(at_900 * side / 900))


def _draw_places(picture: pygame.Surface, telemetry: Telemetry, frame: Projection) -> None:
    """Mark start and goal."""
    first, size = telemetry.states[0], text_size(frame.side, 18)
    goal, start = frame.point(*first[[GOAL_X, GOAL_Y]]), frame.point(*first[[X, Y]])
    pen.circle(picture, scene.GOAL_CIRCLE, goal, telemetry.world.goal_distance * frame.scale, 2)
    pen.circle(picture, TEXT, goal, size / 4)
    pen.write(picture, "goal", (goal[0] + size, goal[1] - size * 0.8), TEXT, size)
    pen.circle(picture, TEXT, start, size / 3, 2)
    pen.write(picture, "start", (start[0] + size, start[1] + size), TEXT, size)


def _draw_tracks(picture: pygame.Surface, telemetry: Telemetry, count: int, frame: Projection) -> None:
    """Draw a dot for each past step, and a larger one every ten."""
    radius = max(1.5, frame.side / 400)
    own, ships = telemetry.states[:, None, [X, Y]], telemetry.ships
    for places, colour in ((ships, SHIP_TRACK), (own, OWN_TRACK)):
        for step, row in enumerate(frame.points(places[:count]).tolist()):
            for place in row:
                pen.circle(picture, colour, place, radius * (1.7 if step % 10 == 0 else 1))


def _draw_hull(
    picture: pygame.Surface, frame: Projection, pose: Numbers, colour: Colour, length: float, to_scale: bool
) -> None:
    drawn = frame.hull(pose, length)
    if to_scale:
        pen.polygon(picture, blend(colour, scene.DISC, 0.6), drawn, 1.2)
        drawn = frame.hull(pose, TRUE_LENGTH)
    pen.polygon(picture, colour, drawn)


def _draw_vector(
    picture: pygame.Surface,
    frame: Projection,
    pose: Numbers,
    way: float,
    hull: float,
    colour: Colour,
    width: float,
) -> None:
    """Draw a ship's speed vector: the way (m) that its bow will make."""
    ahead = np.array([math.cos(pose[HEADING]), math.sin(pose[HEADING])])
    bow = pose[[X, Y]] + hull / 2 * ahead
    if way > 0:
        end = bow + min(way, MAX_VECTOR) * ahead
        pen.strip(picture, colour, frame.point(*bow), frame.point(*end), width)


def _draw_number(picture: pygame.Surface, frame: Projection, pose: Numbers, number: int) -> None:
    """Write a ship's number abeam of it, on a badge so that no line crosses it."""
    right, down = frame.point(*pose[:2])
    ahead, size = pose[HEADING] - frame.up + math.pi / 2, text_size(frame.side, 20)
    reach = scene.TARGET_LENGTH * frame.scale * 0.28 + size * 0.75
    at = (right + reach * math.sin(ahead), down + reach * math.cos(ahead))
    pen.circle(picture, BACKGROUND, at, size * 0.72)
    pen.write(picture, str(number), (at[0], at[1]), scene.TARGET, size, True, across=0.5)


def _draw_north(picture: pygame.Surface, frame: Projection) -> None:
    """Draw an arrow to the north at the top left."""
    reach = max(16.0, frame.side / 28)
    compass = Projection(0.0, 0.0, frame.up, round(3.5 * reach), reach)
    middle = compass.point(0, 0)
    pen.circle(picture, BACKGROUND, middle, reach * 1.45)
    pen.circle(picture, TEXT, middle, reach * 1.45, 1)
    arrow = [compass.point(x, y) for x, y in ((0, 0.6), (0.5, -0.9), (0, -0.55), (-0.5, -0.9))]
    pen.polygon(picture, TEXT, arrow)
    pen.write(picture, "N", compass.point(0, 0.98), TEXT, text_size(frame.side, 17), True, across=0.5)


def _draw_scale(picture: pygame.Surface, frame: Projection) -> None:
    """Draw a bar of known length at the bottom left."""
    metres = next(metres for metres in LENGTHS if metres * frame.scale > 45)
    size, left = text_size(frame.side, 16), frame.side * 0.022
    down, length = frame.side * 0.978, metres * frame.scale
    width = max(length, pen.width_of(f"{metres} m", size))
    box = pygame.Rect(0, 0, width + 2 * left, frame.side - down + 8 + 1.7 * size)
    box.bottomleft = (0, frame.side)
    pygame.draw.rect(picture, BACKGROUND, box, border_top_right_radius=6)
    pygame.draw.rect(picture, TEXT, (left, down - 3, length, 3))
    for end in (left, left + length - 2):
        pygame.draw.rect(picture, TEXT, (end, down - 8, 2, 8))
    pen.write(picture, f"{metres} m", (left, down - 6 - size * 0.75), TEXT, size)


def _draw_outcome(picture: pygame.Surface, outcome: str) -> None:
    """Write at the top how the episode ended."""
    size = text_size(picture.get_width(), 30)
    box = pygame.Rect(0, 0, pen.width_of(outcome.upper(), size, True) + 2 * size, size * 1.8)
    box.midtop = (picture.get_width() // 2, round(size * 0.5))
    pygame.draw.rect(picture, BACKGROUND, box, border_radius=round(size / 2))
    pygame.draw.rect(picture, OUTCOMES[outcome], box, 2, border_radius=round(size / 2))
    pen.write(picture, outcome.upper(), box.center, OUTCOMES[outcome], size, True, across=0.5)
