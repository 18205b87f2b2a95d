"""Pages of small pictures, north up: starts of cases, paths of episodes, cases as the network sees them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, pairwise
from pathlib import Path

import pygame
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.encounter import (
    Encounter,
    are_ruled,
    classify,
    own_velocity,
    relative_motion,
    ship_velocities,
)
from ship_trl.sim.state import (
    HEADING,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_Y,
    goal,
    goal_distance,
    initial_state,
    position,
    target_ships,
)
from ship_trl.sim.transition import Transition
from ship_trl.view import pen
from ship_trl.view.episode import Numbers
from ship_trl.view.painter import (
    MARGIN as AROUND_ALL,
)
from ship_trl.view.painter import (
    Projection,
    draw_goal,
    draw_legend,
    draw_safe_ring,
    draw_scene,
    draw_water,
    hull_length,
)
from ship_trl.view.style import (
    BACKGROUND,
    FAINT,
    OUTCOMES,
    RULE,
    TEXT,
    YELLOW,
    Colour,
    circle_names,
    counted,
)

# Pixels of pages of starts and of paths: small pictures in columns, with captions.
WIDTH, MARGIN, LINE = 1200, 16, 17
STARTS, START_GAP, START_NAME = 5, 16, 22
PATHS, PATH_GAP, PATH_NAME, TITLE, CAPTION = 8, 10, 15, 34, 36
START_PICTURE = (WIDTH - 2 * MARGIN - (STARTS - 1) * START_GAP) // STARTS
PATH_PICTURE = (WIDTH - 2 * MARGIN - (PATHS - 1) * PATH_GAP) // PATHS
MAX_PATHS, MAX_TITLE = 48, 52
# Seconds of the way ahead of a start, and between marks on a path; metres around start and goal of paths.
AHEAD, MARK_TIME, AROUND_PATHS = 20.0, 10.0, 40.0
FAILURES = ("collision", "timeout", "goal")
CLASSES: dict[Encounter, tuple[str, Colour]] = {
    Encounter.HEAD_ON: ("head-on", (255, 110, 100)),
    Encounter.GIVE_WAY: ("give way", (245, 178, 66)),
    Encounter.STAND_ON: ("stand on", (86, 180, 233)),
    Encounter.OVERTAKING: ("overtaking", YELLOW),
    Encounter.OVERTAKEN: ("overtaken", (215, 140, 185)),
    Encounter.NONE: ("no encounter", FAINT),
}
# Pixels of the sheet, whose rows are of single cases; steps between the two moments shown: at the second one
# the ships of the paper's cases are near.
SHEET_PICTURE, SHEET_GAP, SHEET_MARGIN, LABEL, HEAD, LEGEND = 3 * scene.SIZE, 12, 20, 176, 50, 58
SHEET_WIDTH = 2 * SHEET_MARGIN + LABEL + 4 * SHEET_PICTURE + 3 * SHEET_GAP
SHEET_STEPS = 12


def encounter_classes(state: Tensor) -> list[Encounter]:
    """Return the encounter class of each target ship in a state [S]."""
    motion = relative_motion(state.double())
    found = (classify(motion.bearing, motion.aspect) * are_ruled(state, motion)).tolist()
    return [Encounter(one) for one in found[: int(state[SHIP_COUNT])]]


def class_captions(state: Tensor) -> list[tuple[str, Colour]]:
    """Return a text and a colour for each encounter class in a state [S], such as "give way, 2 ships"."""
    classes = encounter_classes(state)
    found = [(classes.count(one), *about) for one, about in CLASSES.items() if one in classes]
    return [(name + (f", {count} ships" if count > 1 else ""), colour) for count, name, colour in found] or [
        ("no target ships", FAINT)
    ]


def write_case_page(path: Path, names: Sequence[str], states: Tensor, world: World) -> None:
    """Write a PNG with a picture, a name and the encounter classes of each state [N, S].

    All pictures have one scale, and the middle of the way from start to goal in the middle.
    """
    captions = [class_captions(state) for state in states]
    lines = [max(map(len, captions[k : k + STARTS])) for k in range(0, len(captions), STARTS)]
    heights = (START_PICTURE + START_NAME + LINE * count + START_GAP for count in lines)
    tops = list(accumulate(heights, initial=MARGIN))
    width = 2 * (max(map(_reach, states)) + AROUND_ALL)
    expected, safe = circle_names(world)
    hull = hull_length(world, START_PICTURE / width)
    page = _new_page(
        tops[-1],
        f"north up, width {width:.0f} m; lines: {AHEAD:g} s on course, in the colour of the class",
        f"blue: goal, {expected}; around own ship: {safe}; hulls drawn {hull:.0f} m long; classes by "
        "Pedersen's sectors",
    )
    for place, (name, state) in enumerate(zip(names, states, strict=True)):
        left, top = MARGIN + place % STARTS * (START_PICTURE + START_GAP), tops[place // STARTS]
        page.blit(draw_start(state, world, START_PICTURE, width), (left, top))
        down = top + START_PICTURE + 0.55 * START_NAME
        pen.write(page, pen.cut(name, START_PICTURE, 16, True), (left, down), TEXT, 16, True)
        for text, colour in captions[place]:
            down += LINE
            pen.write(page, text, (left, down), colour, 13)
    pen.save(page, path)


def write_episode_page(
    path: Path, title: str, names: Sequence[str], episodes: Sequence[Episode], world: World
) -> None:
    """Write a PNG with a picture of each episode, at most `MAX_PATHS`, failures first; all have one scale.

    Args:
        path: of the PNG.
        title: what the episodes have in common.
        names: of the scenes that the episodes begin with, one or more lines each.
        episodes: finished episodes, as many as `names`.
        world: length of a step, and the two circles.
    """
    ends = Counter(one.outcome for one in episodes)
    order = sorted(range(len(episodes)), key=lambda k: FAILURES.index(episodes[k].outcome))[:MAX_PATHS]
    lines = 1 + max(name.count("\n") for name in names)
    height = PATH_PICTURE + CAPTION + (lines - 1) * PATH_NAME + PATH_GAP
    reach = max(float(goal_distance(one.states[0])) / 2 for one in episodes)
    width = 2 * (reach + world.goal_distance + AROUND_PATHS)
    expected, safe = circle_names(world)
    page = _new_page(
        MARGIN + TITLE + math.ceil(len(order) / PATHS) * height,
        f"north up, width {width:.0f} m; a mark every {MARK_TIME:g} s; ships where the episode ends",
        f"captions: end, time, least distance; blue: goal, {expected}; around own ship: {safe}",
    )
    shown = f", {len(order)} shown" if len(order) < len(episodes) else ""
    # The end of a long path says most; the legend stands beside it.
    title = title if len(title) <= MAX_TITLE else f"...{title[-MAX_TITLE:]}"
    text = f"{title}: {counted(len(episodes), 'episode')}{shown}"
    end = pen.write(page, text, (MARGIN, MARGIN + TITLE / 3), TEXT, 18, True)
    for outcome in FAILURES:
        text = f"{outcome} {ends[outcome]}"
        end = pen.write(page, text, (end + 2 * PATH_GAP, MARGIN + TITLE / 3), OUTCOMES[outcome], 15)
    for place, index in enumerate(order):
        one = episodes[index]
        left = MARGIN + place % PATHS * (PATH_PICTURE + PATH_GAP)
        top = MARGIN + TITLE + place // PATHS * height
        page.blit(draw_paths(one, world, PATH_PICTURE, width), (left, top))
        near = f", {one.dcpa:.0f} m" if math.isfinite(one.dcpa) else ""
        caption = f"{one.outcome} {one.length * world.dt:.0f} s{near}"
        y = top + PATH_PICTURE + 10
        for name in names[index].split("\n"):
            pen.write(page, pen.cut(name, PATH_PICTURE, 13, True), (left, y), TEXT, 13, True)
            y += PATH_NAME
        pen.write(page, pen.cut(caption, PATH_PICTURE, 12), (left, y + 1), OUTCOMES[one.outcome], 12)
    pen.save(page, path)


def _new_page(bottom: int, *footer: str) -> pygame.Surface:
    """Make a page for pictures down to `bottom`, with lines below them that explain them."""
    page = pen.new_surface(WIDTH, bottom + len(footer) * LINE + MARGIN, BACKGROUND)
    for line, text in enumerate(footer):
        pen.write(page, text, (MARGIN, bottom + (line + 0.5) * LINE), FAINT, 13)
    return page


def draw_start(state: Tensor, world: World, side: int, width: float) -> pygame.Surface:
    """Draw a state [S] as a square of `width` metres; the colour of a ship's way is that of its class."""
    classes = encounter_classes(state)
    own, ships = state[: HEADING + 1], target_ships(state)[: len(classes), : SHIP_HEADING + 1]
    poses = torch.cat((own[None], ships)).double().numpy()
    ways = torch.cat((own_velocity(state)[None], ship_velocities(state)[: len(classes)])).double().numpy()
    picture, frame = _begin_picture(state, world, side, width)
    draw_safe_ring(picture, frame, world, poses[0])
    colours = [scene.OWN, *(CLASSES[one][1] for one in classes)]
    for pose, way, colour in zip(poses, ways, colours, strict=True):
        ahead = frame.point(*(pose[:2] + AHEAD * way))
        pen.strip(picture, colour, frame.point(*pose[:2]), ahead, 2)
        pen.circle(picture, colour, ahead, 3)
    _draw_hulls(
        picture, frame, world, [(pose, scene.TARGET if k else scene.OWN) for k, pose in enumerate(poses)]
    )
    return picture


def draw_paths(episode: Episode, world: World, side: int, width: float) -> pygame.Surface:
    """Draw an episode's paths as a square of `width` metres; own ship's has the colour of the outcome."""
    states, colour = episode.states.double(), OUTCOMES[episode.outcome]
    picture, frame = _begin_picture(states[0], world, side, width)
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
    _draw_hulls(picture, frame, world, [(poses[-1], hull) for _, poses, hull in tracks])
    return picture


def _begin_picture(state: Tensor, world: World, side: int, width: float) -> tuple[pygame.Surface, Projection]:
    """Draw water and goal around the middle of the way from own ship to the goal in a state [S]."""
    start, end = position(state), goal(state)
    x, y = ((start + end) / 2).tolist()
    frame = Projection(x, y, math.pi / 2, side, side / width)
    picture = draw_water(frame).copy()
    draw_goal(picture, frame, world, start.double().numpy(), end.double().numpy())
    return picture, frame


def _draw_hulls(
    picture: pygame.Surface, frame: Projection, world: World, ships: Sequence[tuple[Numbers, Colour]]
) -> None:
    """Draw hulls to scale; a ship is its pose, x, y (m) and heading (rad), and its colour."""
    for pose, colour in ships:
        pen.polygon(picture, colour, frame.hull(pose, hull_length(world, frame.scale)))


def _reach(state: Tensor) -> float:
    """Return how far (m, along x or y) anything in a state [S] is from the middle of start and goal."""
    ships = target_ships(state)[: int(state[SHIP_COUNT]), : SHIP_Y + 1]
    middle = (position(state) + goal(state)) / 2
    return float((torch.cat((position(state)[None], ships)) - middle).abs().max())


def write_contact_sheet(path: Path, cases: Sequence[Case], world: World) -> None:
    """Write a PNG with a row for each case, as people see it and as the network does.

    A row has the case's name, ideal path and encounter classes, a picture of the start, and one after keeping
    course for `SHEET_STEPS` steps. The network's view of this moment follows, in grey and in colour.
    """
    bottom = HEAD + len(cases) * (SHEET_PICTURE + SHEET_GAP)
    sheet = pen.new_surface(SHEET_WIDTH, bottom + LEGEND, BACKGROUND)
    lefts = [SHEET_MARGIN + LABEL + column * (SHEET_PICTURE + SHEET_GAP) for column in range(4)]
    heads = (
        "at the start",
        f"after {SHEET_STEPS * world.dt:g} s on this course",
        f"as the network sees it, {scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}",
        "the same in colour",
    )
    for left, head in zip(lefts, heads, strict=True):
        pen.write(sheet, head, (left, HEAD - 17), FAINT, 13)
    for row, case in enumerate(cases):
        top, width = HEAD + row * (SHEET_PICTURE + SHEET_GAP), LABEL - SHEET_GAP
        start = initial_state(case, world)
        _write_label(sheet, case, class_captions(start) if case.target_ships else [], top, width)
        later, straight = start[None], torch.tensor([world.straight_action])
        for _ in range(SHEET_STEPS):
            later = Transition(world)(later, straight).state
        pictures = [draw_scene(case, world, state, SHEET_PICTURE, start) for state in (start, later[0])]
        for colour in (False, True):
            seen = make_rasteriser(world, colour=colour)(later[0]).numpy()
            pictures.append(pen.from_array(seen, SHEET_PICTURE))
        for left, picture in zip(lefts, pictures, strict=True):
            sheet.blit(picture, (left, top))
    room = pygame.Rect(SHEET_MARGIN, bottom, SHEET_WIDTH - 2 * SHEET_MARGIN, LEGEND)
    draw_legend(sheet, room, world, 13)
    expected, safe = circle_names(world)
    lengths = f"{scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m"
    text = f"the network sees hulls of {lengths}; around own ship, black: {safe}, red: {expected}"
    pen.write(sheet, text, (SHEET_MARGIN, bottom + 38), FAINT, 13)
    pen.save(sheet, path)


def _write_label(
    sheet: pygame.Surface, case: Case, classes: Sequence[tuple[str, Colour]], top: int, width: int
) -> None:
    """Write name, ideal path and encounter classes of a case at the left of its row."""
    pygame.draw.aaline(sheet, RULE, (SHEET_MARGIN, top), (SHEET_MARGIN + width - SHEET_GAP, top))
    name, ships = f"case {case.name}", counted(len(case.target_ships), "target ship")
    lines = [(55, "ideal path", FAINT), (74, case.ideal_path, TEXT), (112, ships, FAINT)]
    lines += [(131 + 19 * k, text, colour) for k, (text, colour) in enumerate(classes)]
    pen.write(sheet, pen.cut(name, width, 20, True), (SHEET_MARGIN, top + 25), TEXT, 20, True)
    for down, text, shade in lines:
        pen.write(sheet, pen.cut(text, width, 13), (SHEET_MARGIN, top + down), shade, 13)
