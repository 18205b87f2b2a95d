"""The game picture, large: own ship in the middle and heading up (figure 2b), or north up (figure 2a).

What is drawn is what the network sees (`sim/scene.py`), and for people past tracks, numbers, a scale and a
north arrow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pygame

from ship_trl.sim import scene
from ship_trl.sim.dynamics import HEADING, X, Y
from ship_trl.view.lettering import INK, OUTCOMES, PAPER, number
from ship_trl.viewer import pen
from ship_trl.viewer.pen import Point, blend
from ship_trl.viewer.telemetry import Numbers, Telemetry

# Ours, for the paper gives no length: a coaster of 25 m, whose bow stays inside the safe distance.
TRUE_LENGTH = 25.0
RINGS = (200.0, 400.0, 600.0)
FAINT_LINE, GRID = blend(scene.OUTSIDE, scene.DISC, 0.8), blend(scene.OUTSIDE, scene.DISC, 0.22)
# Metres around everything in the absolute frame, and what its width is rounded up to.
MARGIN, ROUND = 90.0, 100.0
SHIP_TRACK, OWN_TRACK = blend(scene.TARGET, scene.DISC, 0.6), blend(scene.OWN, scene.DISC, 0.7)


@dataclass(frozen=True)
class Projection:
    """Metres to pixels: (x, y) is in the middle, what lies in direction `up` (rad) of it above."""

    x: float
    y: float
    up: float
    side: int
    scale: float

    def points(self, places: Numbers) -> Numbers:
        """Project places [..., 2] in metres to pixels [..., 2]."""
        east, north = places[..., 0] - self.x, places[..., 1] - self.y
        cos, sin = math.cos(math.pi / 2 - self.up), math.sin(math.pi / 2 - self.up)
        right, ahead = east * cos - north * sin, east * sin + north * cos
        return np.stack((self.side / 2 + right * self.scale, self.side / 2 - ahead * self.scale), -1)

    def point(self, x: float, y: float) -> Point:
        """Project one place."""
        right, down = self.points(np.array([x, y])).tolist()
        return right, down

    def hull(self, x: float, y: float, heading: float, length: float) -> list[Point]:
        """Project the corners of a ship (m, rad)."""
        corners = np.array(scene.ship_outline(length))
        cos, sin = math.cos(heading), math.sin(heading)
        turned = corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        return [(right, down) for right, down in self.points(turned).tolist()]


def relative_frame(own: Numbers, side: int) -> Projection:
    """Project as the network sees it, own ship (x, y, heading) in the middle and its bow up."""
    return Projection(float(own[0]), float(own[1]), float(own[HEADING]), side, side / (2 * scene.WINDOW))


def absolute_frame(telemetries: tuple[Telemetry, ...], side: int) -> Projection:
    """Project north up, with start, goal, the target ships' starts and all own tracks in the picture."""
    case = telemetries[0].case
    places = [np.array([case.start, case.goal]), telemetries[0].ships[0]]
    places += [telemetry.states[:, [X, Y]] for telemetry in telemetries]
    low, high = np.concatenate(places).min(0), np.concatenate(places).max(0)
    # In whole hundreds of metres, so that an episode that grows seldom changes the scale.
    width = ROUND * math.ceil((float((high - low).max()) + 2 * MARGIN) / ROUND)
    x, y = ((low + high) / 2).tolist()
    return Projection(x, y, math.pi / 2, side, side / width)


def draw_sea(
    picture: pygame.Surface,
    telemetry: Telemetry,
    position: float,
    absolute: Projection | None = None,
    to_scale: bool = False,
) -> None:
    """Fill a square surface with the picture at a step or between two.

    Args:
        picture: where it is drawn.
        telemetry: the episode.
        position: steps from the start, whole or not.
        absolute: a frame in which all ships move (figure 2a); if None own ship stays in the middle (2b).
        to_scale: hulls as long as ships are, with a ghost of what the network sees.
    """
    world, side = telemetry.world, picture.get_width()
    own, ships = telemetry.between(position)
    frame = absolute or relative_frame(own, side)
    ground = _water(side, frame) if absolute else _rings(side, world.goal_distance, world.safe_distance)
    picture.blit(ground, (0, 0))
    middle = frame.point(float(own[0]), float(own[1]))
    if absolute:
        _places(picture, telemetry, frame)
        pen.circle(picture, scene.GOAL_CIRCLE, middle, world.goal_distance * frame.scale)
        pen.circle(picture, scene.SAFE_CIRCLE, middle, world.safe_distance * frame.scale)
    _tracks(picture, telemetry, position, frame)
    pen.line(picture, scene.LINE, middle, frame.point(*telemetry.case.goal), max(2, side // 220))
    _hull(picture, frame, own, scene.OWN, scene.OWN_LENGTH, to_scale)
    for k, (ship, place) in enumerate(zip(telemetry.case.target_ships, ships, strict=True), 1):
        pose = np.array([place[0], place[1], math.radians(ship.heading)])
        _hull(picture, frame, pose, scene.TARGET, scene.TARGET_LENGTH, to_scale)
        _number(picture, frame, pose, k)
    _north(picture, frame)
    _scale(picture, frame)
    if telemetry.outcome and position >= telemetry.steps:
        _ending(picture, telemetry.outcome)


@lru_cache(4)
def _rings(side: int, goal_distance: float, safe_distance: float) -> pygame.Surface:
    picture = pygame.Surface((side, side), depth=32)
    picture.fill(scene.OUTSIDE)
    middle, scale = (side / 2, side / 2), side / (2 * scene.WINDOW)
    pen.circle(picture, scene.DISC, middle, scene.WINDOW * scale)
    for radius in RINGS:
        pen.circle(picture, GRID, middle, radius * scale, 1)
        size = _size(side, 15)
        at = (side / 2 + 0.6 * radius * scale, side / 2 + 0.8 * radius * scale)
        pen.write(picture, f"{radius:.0f} m", at, FAINT_LINE, size, across=1.1)
    pen.circle(picture, scene.GOAL_CIRCLE, middle, goal_distance * scale)
    pen.circle(picture, scene.SAFE_CIRCLE, middle, safe_distance * scale)
    return picture


@lru_cache(4)
def _water(side: int, frame: Projection) -> pygame.Surface:
    """Draw water with a grid, and what its lines are."""
    picture = pygame.Surface((side, side), depth=32)
    picture.fill(scene.DISC)
    half = side / frame.scale / 2
    step = next(step for step in (50, 100, 200, 500, 1000, 2000, 5000, 10000, 10**9) if half / step < 6)
    size = _size(side, 15)
    # Where the scale bar lies there is no room for a number.
    for value in range(math.ceil((frame.x - half) / step) * step, math.ceil(frame.x + half), step):
        right = frame.point(value, 0)[0]
        pen.line(picture, GRID, (right, 0), (right, side))
        if right > 0.16 * side:
            pen.write(picture, number(value, "g"), (right + 4, side - size), FAINT_LINE, size)
    for value in range(math.ceil((frame.y - half) / step) * step, math.ceil(frame.y + half), step):
        down = frame.point(0, value)[1]
        pen.line(picture, GRID, (0, down), (side, down))
        if down < side - 2.5 * size:
            pen.write(picture, number(value, "g"), (side - 6, down - size / 1.5), FAINT_LINE, size, across=1)
    return picture


def _size(side: int, at_900: int) -> int:
    """Give the size of letters in a picture of `side` pixels."""
    return max(12, round(at_900 * side / 900))


def _places(picture: pygame.Surface, telemetry: Telemetry, frame: Projection) -> None:
    """Mark start and goal, and where the target ships came from."""
    case, size = telemetry.case, _size(frame.side, 18)
    goal, start = frame.point(*case.goal), frame.point(*case.start)
    pen.circle(picture, scene.GOAL_CIRCLE, goal, telemetry.world.goal_distance * frame.scale, 2)
    for turn in (0.25, 0.75):
        dx, dy = size / 2 * math.cos(turn * math.pi), size / 2 * math.sin(turn * math.pi)
        pen.line(picture, INK, (goal[0] - dx, goal[1] - dy), (goal[0] + dx, goal[1] + dy), 3)
    pen.write(picture, "goal", (goal[0] + size, goal[1] - size * 0.8), INK, size)
    pen.circle(picture, INK, start, size / 3, 2)
    pen.write(picture, "start", (start[0] + size, start[1] + size), INK, size)


def _tracks(picture: pygame.Surface, telemetry: Telemetry, position: float, frame: Projection) -> None:
    """Leave a dot for each second past, a larger one every ten."""
    count = math.ceil(position)
    if position <= 0:
        return
    radius = max(1.5, frame.side / 400)
    own = frame.points(telemetry.states[:count, None, [X, Y]])
    ships = frame.points(telemetry.ships[:count])
    for places, colour in ((ships, SHIP_TRACK), (own, OWN_TRACK)):
        for step, row in enumerate(places.tolist()):
            for place in row:
                pen.circle(picture, colour, place, radius * (1.7 if step % 10 == 0 else 1))


def _hull(
    picture: pygame.Surface,
    frame: Projection,
    pose: Numbers,
    colour: pen.Colour,
    length: float,
    to_scale: bool,
) -> None:
    x, y, heading = pose.tolist()
    large = frame.hull(x, y, heading, length)
    if not to_scale:
        pen.polygon(picture, colour, large)
        return
    # The ghost of what the network sees.
    pen.polygon(picture, blend(colour, scene.DISC, 0.6), large, 1.2)
    pen.polygon(picture, colour, frame.hull(x, y, heading, TRUE_LENGTH))


def _number(picture: pygame.Surface, frame: Projection, pose: Numbers, number: int) -> None:
    """Write a ship's number abeam of it, on a ground of its own so that no line goes through it."""
    x, y, heading = pose.tolist()
    right, down = frame.point(x, y)
    ahead, size = heading - frame.up + math.pi / 2, _size(frame.side, 20)
    reach = scene.TARGET_LENGTH * frame.scale * 0.28 + size * 0.75
    at = (right + reach * math.sin(ahead), down + reach * math.cos(ahead))
    pen.circle(picture, PAPER, at, size * 0.72)
    pen.write(picture, str(number), (at[0], at[1]), scene.TARGET, size, True, across=0.5)


def _north(picture: pygame.Surface, frame: Projection) -> None:
    """Draw an arrow to the north, top left."""
    reach = max(16.0, frame.side / 28)
    x = y = reach * 1.75
    turn = frame.up - math.pi / 2
    along, beside = (math.sin(turn), -math.cos(turn)), (math.cos(turn), math.sin(turn))

    def place(ahead: float, right: float) -> Point:
        return (
            x + reach * (ahead * along[0] + right * beside[0]),
            y + reach * (ahead * along[1] + right * beside[1]),
        )

    pen.circle(picture, PAPER, (x, y), reach * 1.45)
    pen.circle(picture, INK, (x, y), reach * 1.45, 1)
    pen.polygon(picture, INK, [place(0.6, 0), place(-0.9, 0.5), place(-0.55, 0), place(-0.9, -0.5)])
    pen.write(picture, "N", place(0.98, 0), INK, _size(frame.side, 17), True, across=0.5)


def _scale(picture: pygame.Surface, frame: Projection) -> None:
    """Draw a bar of known length, bottom left."""
    metres = next(m for m in (50, 100, 200, 500, 1000, 2000, 5000, 10**4, 10**5) if m * frame.scale > 45)
    size, left = _size(frame.side, 16), frame.side * 0.022
    down, length = frame.side * 0.978, metres * frame.scale
    width = max(length, pen.width_of(f"{metres} m", size))
    ground = pygame.Rect(0, 0, width + 2 * left, frame.side - down + 8 + 1.7 * size)
    ground.bottomleft = (0, frame.side)
    pygame.draw.rect(picture, PAPER, ground, border_top_right_radius=6)
    pygame.draw.rect(picture, INK, (left, down - 3, length, 3))
    for right in (left, left + length - 2):
        pygame.draw.rect(picture, INK, (right, down - 8, 2, 8))
    pen.write(picture, f"{metres} m", (left, down - 6 - size * 0.75), INK, size)


def _ending(picture: pygame.Surface, outcome: str) -> None:
    """Say how it ended, at the top."""
    size = _size(picture.get_width(), 30)
    text, middle = outcome.upper(), picture.get_width() / 2
    ground = pygame.Rect(0, 0, pen.width_of(text, size, True) + 2 * size, size * 1.8)
    ground.midtop = (round(middle), round(size * 0.5))
    pygame.draw.rect(picture, PAPER, ground, border_radius=round(size / 2))
    pygame.draw.rect(picture, OUTCOMES[outcome], ground, 2, border_radius=round(size / 2))
    pen.write(picture, text, (middle, ground.centery), OUTCOMES[outcome], size, True, across=0.5)
