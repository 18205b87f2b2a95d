"""Paint scenes for people: a map, north up (figure 2a), or own ship in the middle, heading up (figure 2b).

Hulls are to scale, so that ships which pass each other do not touch. The network's larger hulls and circles
are drawn by `ship_trl.sim.render`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, tee

import numpy as np
import pygame
import torch
from torch import Tensor

from ship_trl.config.bounds import NAUTICAL_MILE
from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.sim.scale import Scale
from ship_trl.sim.state import GOAL_X, GOAL_Y, HEADING, SPEED, X, Y
from ship_trl.view import pen, style
from ship_trl.view.episode import Numbers, Telemetry
from ship_trl.view.pen import Point

# Metres. The paper gives no length: a coaster, whose bow stays inside the safe distance.
TRUE_LENGTH = 25.0
# A hull of fewer pixels is drawn longer, but two hulls at the safe distance never touch.
LEAST_PIXELS, HULLS_IN_SAFE_DISTANCE = 9.0, 1.2
GRID = style.blend(scene.OUTSIDE, scene.DISC, 0.22)
GOAL_AREA = style.blend(style.GOAL_MARK, scene.DISC, 0.16)
SHIP_TRACK, OWN_TRACK = style.blend(scene.TARGET, scene.DISC, 0.6), style.blend(scene.OWN, scene.DISC, 0.7)
# A picture of fewer pixels has no labels.
SMALL_SIDE = 240
# Radius of the badge behind a number, in sizes of its letters. A label that finds its place taken tries these
# turns around its ship, on rings half its height apart.
NORTH, BADGE, RINGS = "N", 0.72, 12
TURNS = [k * math.pi / 4 for k in (0, 4, 2, 6, 1, 7, 3, 5)]
# Metres around everything on the map, and the step to which its width is rounded up.
MARGIN, WIDTH_STEP = 90.0, 100.0
# Seconds of the way that a speed vector shows. A longer vector than this (m) is cut, outside the picture.
VECTOR_TIME, MAX_VECTOR = 10.0, 4 * scene.VIEW_RADIUS
# Metres between the lines of a grid, or of a scale bar.
LENGTHS = (50, 100, 200, 500, 1000, 2000, 5000, 10**4, 10**5)
# Nautical miles of a scale bar.
MILES = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 1000, 10**4)


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


def map_frame(telemetries: Sequence[Telemetry], side: int) -> Projection:
    """Return a north-up projection that shows start, goal, the target ships' starts and all own tracks."""
    first = telemetries[0].states[:1]
    places = [first[:, [X, Y]], first[:, [GOAL_X, GOAL_Y]], telemetries[0].ships[0]]
    places += [telemetry.states[:, [X, Y]] for telemetry in telemetries]
    low, high = np.concatenate(places).min(0), np.concatenate(places).max(0)
    # Rounded, so that a growing episode seldom changes the scale.
    width = WIDTH_STEP * math.ceil((float((high - low).max()) + 2 * MARGIN) / WIDTH_STEP)
    x, y = ((low + high) / 2).tolist()
    return Projection(x, y, math.pi / 2, side, side / width)


def hull_length(world: World, scale: float) -> float:
    """Return the length (m) of hulls at a scale in pixels per metre."""
    return min(world.safe_distance / HULLS_IN_SAFE_DISTANCE, max(TRUE_LENGTH, LEAST_PIXELS / scale))


def draw_scene(world: World, state: Tensor, size: int = 600, start: Tensor | None = None) -> pygame.Surface:
    """Draw one state [S] on a map, a square of `size` pixels.

    The map stays still while the states of an episode share their `start` [S]; default: the state.
    """
    first, now = (still(world, one) for one in (state if start is None else start, state))
    picture = pen.new_surface(size, size)
    paint_scene(picture, now, 0.0, map_frame((first, now), size))
    return picture


def still(world: World, state: Tensor) -> Telemetry:
    """Return the telemetry of an episode without steps that begins with a state [S]."""
    return Telemetry(world, state[None], torch.zeros(0, dtype=torch.int64))


def paint_scene(
    picture: pygame.Surface,
    telemetry: Telemetry,
    position: float,
    frame: Projection,
    large: bool = False,
    track: style.Colour = OWN_TRACK,
    ways: Sequence[style.Colour] = (),
    ahead: float = VECTOR_TIME,
    sea: Scale | None = None,
    labels: bool = True,
) -> None:
    """Fill a square surface with the scene at a position in steps; a small one has no words.

    Args:
        picture: the surface.
        telemetry: the episode.
        position: in steps.
        frame: where things are on the surface.
        large: whether hulls are as long as the network sees them; else they are to scale.
        track: colour of own ship's track.
        ways: colours of the ways ahead, own ship's first; default: quiet ones.
        ahead: seconds of these ways.
        sea: the scale of a scene of another tool, shown beside the simulator's.
        labels: whether there are words and numbers where there is room.
    """
    world, step = telemetry.world, min(int(position), telemetry.steps)
    own, ships = telemetry.at(position)
    start, goal = telemetry.states[0, [X, Y]], telemetry.states[0, [GOAL_X, GOAL_Y]]
    thin = max(1.5, frame.side / 450)
    picture.blit(_draw_water(frame), (0, 0))
    at, radius = frame.point(*goal), world.goal_distance * frame.scale
    pen.strip(picture, style.RULE, frame.point(*start), at, thin)
    pen.circle(picture, GOAL_AREA, at, radius)
    pen.circle(picture, style.GOAL_MARK, at, radius, 2)
    # A dot for each past step, and a larger one every ten.
    for places, colour in ((telemetry.ships, SHIP_TRACK), (telemetry.states[:, None, [X, Y]], track)):
        for past, row in enumerate(frame.points(places[: math.ceil(position)]).tolist()):
            for place in row:
                large_dot = 1.7 if past % 10 == 0 else 1
                pen.circle(picture, colour, place, max(1.5, frame.side / 400) * large_dot)
    has_ended = telemetry.outcome is not None and position >= telemetry.steps
    is_near = np.linalg.norm(ships - own[:2], axis=-1).min(initial=math.inf) < world.safe_distance
    is_danger = is_near or (has_ended and telemetry.outcome == "collision")
    colour, width = (style.DANGER, 3.0) if is_danger else (style.FAINT, max(1.0, frame.side / 600))
    pen.circle(picture, colour, frame.point(*own[:2]), world.safe_distance * frame.scale, width)
    poses, lengths = ship_poses(telemetry, position, frame, large)
    speeds = [telemetry.states[step, SPEED], *telemetry.speeds[step]]
    for pose, way, speed in zip(poses, ways or [OWN_TRACK, *[SHIP_TRACK] * len(ships)], speeds, strict=True):
        course = np.array([math.cos(pose[HEADING]), math.sin(pose[HEADING])])
        end = pose[:2] + min(speed * ahead, MAX_VECTOR) * course
        pen.strip(picture, way, frame.point(*pose[:2]), frame.point(*end), 2.0 if ways else thin)
    placed = place_labels(telemetry, position, frame, large, sea) if labels else {}
    for words, box in placed.items():
        at = frame.point(*poses[int(words)][:2]) if words.isdecimal() else box.center
        _draw_label(picture, frame, words, box, at)
    for k, (pose, drawn) in enumerate(zip(poses, lengths, strict=True)):
        pen.polygon(picture, scene.TARGET if k else scene.OWN, frame.hull(pose, drawn))


def ship_poses(
    telemetry: Telemetry, position: float, frame: Projection, large: bool
) -> tuple[list[Numbers], list[float]]:
    """Return x, y, heading of all ships, own ship's first, and the lengths (m) of their hulls."""
    own, ships = telemetry.at(position)
    poses = [own, *np.column_stack((ships, telemetry.headings[min(int(position), telemetry.steps)]))]
    true = hull_length(telemetry.world, frame.scale)
    own_length, length = (scene.OWN_LENGTH, scene.TARGET_LENGTH) if large else (true, true)
    return poses, [own_length, *[length] * len(ships)]


def place_labels(
    telemetry: Telemetry,
    position: float,
    frame: Projection,
    large: bool = False,
    sea: Scale | None = None,
) -> dict[str, pygame.Rect]:
    """Return the box of each label in the picture of a scene by its words; no two overlap, and all are whole.

    The labels are the arrow to the north "N", the scale "200 m", the outcome "GOAL" after the last step, the
    word "goal", and the numbers of the target ships from "1" on. With the scale at sea there are also "1 NM",
    and the time "08:30 UTC" or "+12 min". Where there is room, labels keep clear of hulls. What is outside
    the picture has no label, and a small picture has none at all.
    """
    side = frame.side
    if side < SMALL_SIDE:
        return {}
    reach, size, left = north_reach(side), text_size(side, 16), 0.022 * side
    found = {NORTH: _box((1.75 * reach, 1.75 * reach), (3 * reach, 3 * reach))}
    units: list[tuple[str, Sequence[float], float]] = [("m", LENGTHS, frame.scale)]
    if sea is not None:
        units.append(("NM", MILES, frame.scale * NAUTICAL_MILE / sea.length))
        words = sea.clock(position * telemetry.world.dt)
        found[words] = pygame.Rect(0, 0, pen.width_of(words, size) + 2 * left, 2 * size)
        found[words].bottomright = (side, side)
    bottom = side
    for unit, lengths, pixels in units:
        length = next(length for length in lengths if length * pixels > max(45, 3.5 * size))
        bar = pygame.Rect(0, 0, length * pixels + 2 * left, left + 8 + 1.7 * size)
        bar.bottomleft = (0, bottom)
        found[f"{length} {unit}"], bottom = bar, bar.top
    if telemetry.outcome is not None and position >= telemetry.steps:
        words, size = telemetry.outcome.upper(), text_size(side, 30)
        width = pen.width_of(words, size, True) + 2 * size
        found[words] = _box((side / 2, 1.4 * size), (width, 1.8 * size))
    poses, lengths = ship_poses(telemetry, position, frame, large)
    corners = [frame.hull(pose, one) for pose, one in zip(poses, lengths, strict=True)]
    hulls = [pygame.Rect(*np.min(one, 0), *np.ptp(one, 0)) for one in corners]
    size, badge = text_size(side, 18), 2 * BADGE * text_size(side, 20)
    goal, word = telemetry.states[0, [GOAL_X, GOAL_Y]], (pen.width_of("goal", size), size)
    wanted: list[tuple[str, Numbers, float, float, tuple[float, float], list[pygame.Rect]]]
    wanted = [("goal", goal, 0.0, 0.0, word, hulls)]
    for k, (pose, length) in enumerate(zip(poses[1:], lengths[1:], strict=True), 1):
        # Abeam, so that neither the track nor the way ahead crosses it.
        angle, away = frame.up - pose[HEADING], length * frame.scale * 0.28 + 0.52 * badge
        wanted.append((str(k), pose[:2], angle, away, (badge, badge), hulls[:k] + hulls[k + 1 :]))
    picture = pygame.Rect(0, 0, side, side)
    for words, at, angle, away, sides, others in wanted:
        x, y = frame.point(*at)
        polar = ((away + k * sides[1] / 2, angle + turn) for k in range(RINGS) for turn in TURNS)
        boxes = (_box((x + r * math.cos(turn), y + r * math.sin(turn)), sides) for r, turn in polar)
        taken = list(found.values())
        free, again = tee(box for box in boxes if picture.contains(box) and box.collidelist(taken) < 0)
        clear = (box for box in free if box.collidelist(others) < 0)
        place = next(chain(clear, again), None) if picture.collidepoint(x, y) else None
        found |= {} if place is None else {words: place}
    return found


def _box(middle: Point, sides: tuple[float, float]) -> pygame.Rect:
    """Return the whole pixels of a rectangle around a point."""
    box = pygame.Rect((0, 0), [math.ceil(side) for side in sides])
    box.center = round(middle[0]), round(middle[1])
    return box


@lru_cache(4)
def _draw_water(frame: Projection) -> pygame.Surface:
    """Draw water with a grid."""
    side = frame.side
    picture = pen.new_surface(side, side, scene.DISC)
    half = side / frame.scale / 2
    step = next((step for step in LENGTHS if half / step < 6), 10**9)
    # The corners of a picture that is turned are farther away than its sides.
    reach = 2**0.5 * half
    for place in (X, Y):
        middle = (frame.x, frame.y)[place]
        for at in range(math.ceil((middle - reach) / step) * step, math.ceil(middle + reach), step):
            ends = np.array([[frame.x - reach, frame.y - reach], [frame.x + reach, frame.y + reach]])
            ends[:, place] = at
            pygame.draw.aaline(picture, GRID, *frame.points(ends).tolist())
    return picture


def text_size(side: int, at_900: int) -> int:
    """Scale a size of letters to a picture of `side` pixels."""
    return max(12, round(at_900 * side / 900))


def north_reach(side: int) -> float:
    """Return the pixels of half an arrow to the north in a picture of `side` pixels."""
    return max(16.0, side / 28)


def _draw_label(picture: pygame.Surface, frame: Projection, words: str, box: pygame.Rect, at: Point) -> None:
    """Draw a label of `place_labels`; `at` is the ship to which a number belongs."""
    side = frame.side
    if words == NORTH:
        reach = north_reach(side)
        compass = Projection(0.0, 0.0, frame.up, round(3.5 * reach), reach)
        pen.circle(picture, style.BACKGROUND, box.center, reach * 1.45)
        pen.circle(picture, style.TEXT, box.center, reach * 1.45, 1)
        arrow = [compass.point(x, y) for x, y in ((0, 0.6), (0.5, -0.9), (0, -0.55), (-0.5, -0.9))]
        pen.polygon(picture, style.TEXT, arrow)
        pen.write(picture, words, compass.point(0, 0.98), style.TEXT, text_size(side, 17), True, across=0.5)
    elif words.endswith((" UTC", " min")):
        pygame.draw.rect(picture, style.BACKGROUND, box, border_top_left_radius=6)
        pen.write(picture, words, box.center, style.TEXT, text_size(side, 16), across=0.5)
    elif words.endswith((" m", " NM")):
        size, left, down = text_size(side, 16), 0.022 * side, 0.978 * side - (side - box.bottom)
        length = box.width - 2 * left
        pygame.draw.rect(picture, style.BACKGROUND, box, border_top_right_radius=6)
        pygame.draw.rect(picture, style.TEXT, (left, down - 3, length, 3))
        for end in (left, left + length - 2):
            pygame.draw.rect(picture, style.TEXT, (end, down - 8, 2, 8))
        pen.write(picture, words, (left, down - 6 - size * 0.75), style.TEXT, size)
    elif words.isdecimal():
        # A line leads to a ship whose usual place was taken.
        if math.dist(at, box.center) > 2.5 * box.width:
            pygame.draw.aaline(picture, style.FAINT, at, box.center)
        pen.circle(picture, style.BACKGROUND, box.center, box.width / 2)
        pen.write(picture, words, box.center, scene.TARGET, text_size(side, 20), True, across=0.5)
    elif words.isupper():
        size, colour = text_size(side, 30), style.OUTCOMES[words.lower()]
        pygame.draw.rect(picture, style.BACKGROUND, box, border_radius=round(size / 2))
        pygame.draw.rect(picture, colour, box, 2, border_radius=round(size / 2))
        pen.write(picture, words, box.center, colour, size, True, across=0.5)
    else:
        pen.write(picture, words, box.center, style.GOAL_MARK, text_size(side, 18), across=0.5)


def draw_legend(
    surface: pygame.Surface, room: pygame.Rect, world: World, size: int, scale: float, large: bool = False
) -> None:
    """Explain a scene of `scale` pixels a metre from the top left of a room, in as many lines as needed.

    If `large`, hulls are as long as the network sees them.
    """
    hulls = f"hulls {hull_length(world, scale):.0f} m"
    if large:
        hulls = f"hulls as for the network, {scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
    items = [
        (scene.OWN, "own ship"),
        (scene.TARGET, "target ship"),
        (style.GOAL_MARK, f"goal, {world.goal_distance:g} m"),
        (style.FAINT, f"ring: safe distance {world.safe_distance:g} m"),
        (style.DANGER, "entered"),
        (scene.TARGET, f"line: {VECTOR_TIME:g} s ahead"),
        (scene.OWN, f"dots: {world.dt:g} s apart"),
        (style.CHOSEN, hulls),
    ]
    pen.flow(surface, items, room, size)
