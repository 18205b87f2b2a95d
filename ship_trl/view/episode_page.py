"""Draw the paths of many episodes on one page, north up, failures first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pygame

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.state import SHIP_COUNT, SHIP_HEADING, goal, goal_distance, position, target_ships
from ship_trl.view import pen
from ship_trl.view.painter import Projection, draw_goal, draw_safe_ring, draw_water, hull_length
from ship_trl.view.palette import BACKGROUND, FAINT, OUTCOMES, TEXT
from ship_trl.view.words import circle_names, counted

# Pixels. A caption has the name, and how the episode ends.
WIDTH, MARGIN, GAP, COLUMNS, MAX_PICTURES = 1200, 16, 10, 8, 48
PICTURE = (WIDTH - 2 * MARGIN - (COLUMNS - 1) * GAP) // COLUMNS
TITLE, CAPTION, LINE = 34, 36, 17
NAME_LINE = 15
# Seconds between marks on a path, and metres around start and goal.
MARK_TIME, AROUND = 10.0, 40.0
FAILURES = ("collision", "timeout", "goal")
MAX_TITLE = 52


def write_episode_page(
    path: Path, title: str, names: Sequence[str], episodes: Sequence[Episode], world: World
) -> None:
    """Write a PNG with a picture of each episode, at most `MAX_PICTURES`; all have one scale.

    Args:
        path: of the PNG.
        title: what the episodes have in common.
        names: of the scenes that the episodes begin with, one or more lines each.
        episodes: finished episodes, as many as `names`.
        world: length of a step, and the two circles.
    """
    ends = Counter(one.outcome for one in episodes)
    order = sorted(range(len(episodes)), key=lambda k: FAILURES.index(episodes[k].outcome))[:MAX_PICTURES]
    lines = 1 + max(name.count("\n") for name in names)
    rows, height = math.ceil(len(order) / COLUMNS), PICTURE + CAPTION + (lines - 1) * NAME_LINE + GAP
    bottom = MARGIN + TITLE + rows * height
    page = pen.new_surface(WIDTH, bottom + 2 * LINE + MARGIN, BACKGROUND)
    reach = max(float(goal_distance(one.states[0])) / 2 for one in episodes) + world.goal_distance + AROUND
    shown = f", {len(order)} shown" if len(order) < len(episodes) else ""
    # The end of a long path says most; the legend stands beside it.
    title = title if len(title) <= MAX_TITLE else f"...{title[-MAX_TITLE:]}"
    text = f"{title}: {counted(len(episodes), 'episode')}{shown}"
    end = pen.write(page, text, (MARGIN, MARGIN + TITLE / 3), TEXT, 18, True)
    for outcome in FAILURES:
        text = f"{outcome} {ends[outcome]}"
        end = pen.write(page, text, (end + 2 * GAP, MARGIN + TITLE / 3), OUTCOMES[outcome], 15)
    for place, index in enumerate(order):
        one = episodes[index]
        left = MARGIN + place % COLUMNS * (PICTURE + GAP)
        top = MARGIN + TITLE + place // COLUMNS * height
        page.blit(draw_paths(one, world, PICTURE, 2 * reach), (left, top))
        near = f", {one.dcpa:.0f} m" if math.isfinite(one.dcpa) else ""
        caption = f"{one.outcome} {one.length * world.dt:.0f} s{near}"
        y = top + PICTURE + 10
        for name in names[index].split("\n"):
            pen.write(page, pen.cut(name, PICTURE, 13, True), (left, y), TEXT, 13, True)
            y += NAME_LINE
        pen.write(page, pen.cut(caption, PICTURE, 12), (left, y + 1), OUTCOMES[one.outcome], 12)
    expected, safe = circle_names(world)
    first = f"north up, width {2 * reach:.0f} m; a mark every {MARK_TIME:g} s; ships where the episode ends"
    second = f"captions: end, time, least distance; blue: goal, {expected}; around own ship: {safe}"
    for line, text in enumerate((first, second)):
        pen.write(page, text, (MARGIN, bottom + (line + 0.5) * LINE), FAINT, 13)
    pen.save(page, path)


def draw_paths(episode: Episode, world: World, side: int, width: float) -> pygame.Surface:
    """Draw an episode's paths as a square of `width` metres; own ship's has the colour of the outcome."""
    states, colour = episode.states.double(), OUTCOMES[episode.outcome]
    start, end = position(states[0]), goal(states[0])
    x, y = ((start + end) / 2).tolist()
    frame = Projection(x, y, math.pi / 2, side, side / width)
    picture = draw_water(frame).copy()
    draw_goal(picture, frame, world, start.numpy(), end.numpy())
    ships = target_ships(states)[:, : int(states[0, SHIP_COUNT])]
    tracks = [(FAINT, ships[:, k, : SHIP_HEADING + 1].numpy(), scene.TARGET) for k in range(ships.shape[1])]
    tracks.append((colour, states[:, : SHIP_HEADING + 1].numpy(), scene.OWN))
    every = max(1, round(MARK_TIME / world.dt))
    for shade, poses, _ in tracks:
        places = frame.points(poses[:, :2]).tolist()
        for one, other in pairwise(places):
            pen.strip(picture, shade, one, other, 2.5 if shade == colour else 1.2)
        for mark in places[::every]:
            pen.circle(picture, shade, mark, 2)
    draw_safe_ring(picture, frame, world, position(states[-1]).numpy(), episode.outcome == "collision")
    for _, poses, hull in tracks:
        pen.polygon(picture, hull, frame.hull(poses[-1], hull_length(world, frame.scale)))
    return picture
