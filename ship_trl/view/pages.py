"""Pages of small pictures, north up: starts of cases, paths of episodes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate, zip_longest
from pathlib import Path

import pygame
import torch
from torch import Tensor

from ship_trl.config.errors import counted
from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim import state as col
from ship_trl.sim.encounter import Encounter, are_ruled, classify, relative_motion
from ship_trl.sim.scale import Scale
from ship_trl.sim.state import goal, goal_distance, position, target_ships
from ship_trl.view import pen
from ship_trl.view.episode import measure_episode
from ship_trl.view.painter import Projection, hull_length, paint_scene, still
from ship_trl.view.style import BACKGROUND, FAINT, OUTCOMES, TEXT, YELLOW, Colour, circle_names

# Pixels around and between pictures, and of the sides of pictures.
MARGIN, GAP = 16, 12
MAX_START_SIDE, PATH_SIDE = 760, 140
# Pixels in a row of starts, and pictures in a row.
STARTS_WIDTH, STARTS, PATHS = 1148, 4, 8
# Smaller pictures have no labels, which would hide ships; the footer tells the scale.
LABELLED = 300
# Letters in pixels of names, of other captions and of the footer of a page of starts: a phone shows a third.
NAME, CAPTION, STARTS_FOOTER = 28, 24, 22
# Side, columns, and letters of names and of other lines, of a page of all episodes and of failures alone.
TRIED, FAILED = (PATH_SIDE, PATHS, 13, 12), (250, 3, 18, 16)
MAX_PATHS, MAX_TITLE = 48, 52
# Seconds of the way ahead of a start: the ships of Imazu's problems meet after these.
AHEAD = 20.0
# Metres around the scenes, and around start and goal of paths.
AROUND_SCENES, AROUND_PATHS = 90.0, 40.0
FAILURES = ("collision", "timeout", "goal")
CLASSES: dict[Encounter, tuple[str, Colour]] = {
    Encounter.HEAD_ON: ("head-on", (255, 110, 100)),
    Encounter.GIVE_WAY: ("give way", (245, 178, 66)),
    Encounter.STAND_ON: ("stand on", (86, 180, 233)),
    Encounter.OVERTAKING: ("overtaking", YELLOW),
    Encounter.OVERTAKEN: ("overtaken", (215, 140, 185)),
    Encounter.NONE: ("no encounter", FAINT),
}
# A line of text: its words, letters in pixels, and colour.
Line = tuple[str, int, Colour]
Cell = tuple[pygame.Surface, Sequence[Line]]
Scales = Sequence[Scale | None]


def encounter_classes(state: Tensor) -> list[Encounter]:
    """Return the encounter class of each target ship in a state [S]."""
    motion = relative_motion(state.double())
    found = (classify(motion.bearing, motion.aspect) * are_ruled(state, motion)).tolist()
    return [Encounter(one) for one in found[: int(state[col.SHIP_COUNT])]]


def class_captions(state: Tensor) -> list[Line]:
    """Return a caption for each encounter class in a state [S], such as "give way, 2 ships"."""
    classes = encounter_classes(state)
    found = [(classes.count(one), *about) for one, about in CLASSES.items() if one in classes]
    lines = [
        (name + (f", {count} ships" if count > 1 else ""), CAPTION, colour) for count, name, colour in found
    ]
    return lines or [("no target ships", CAPTION, FAINT)]


def write_case_page(
    path: Path, names: Sequence[str], states: Tensor, world: World, scales: Scales = ()
) -> None:
    """Write a PNG with a picture, a name and the encounter classes of each state [N, S].

    All pictures have one scale, and the middle of the way from start to goal in the middle; few are larger.
    `scales` are those at sea of scenes of other tools, as many as names.
    """
    width = 2 * (max(map(_reach, states)) + AROUND_SCENES)
    columns = min(STARTS, len(names))
    side = min(MAX_START_SIDE, (STARTS_WIDTH + GAP) // columns - GAP)
    cells = [
        (draw_start(state, world, side, width, sea), [*_captions(name, world, sea), *class_captions(state)])
        for name, state, sea in zip_longest(names, states, scales)
    ]
    (expected, safe), hull = circle_names(world), hull_length(world, side / width)
    scale = f"north up, width {width:.0f} m; hulls drawn {hull:.0f} m long; blue: goal, {expected}"
    footer = (
        f"{scale}; around own ship: {safe}",
        f"lines: {AHEAD:g} s ahead, in the colour of the class; classes by Pedersen's sectors"
        + _width_at_sea(width, scales),
    )
    _write_page(path, cells, columns, footer, letters=STARTS_FOOTER)


def _captions(name: str, world: World, sea: Scale | None) -> list[Line]:
    """Return a name in large letters, and the scale at sea in small ones."""
    words = [] if sea is None else sea.describe(world).split(", ")
    return [(name, NAME, TEXT), *((line, CAPTION, FAINT) for line in words)]


def write_episode_page(
    path: Path,
    title: str,
    names: Sequence[str],
    episodes: Sequence[Episode],
    world: World,
    scales: Scales = (),
    failures: bool = False,
) -> None:
    """Write a PNG with a picture of each episode, at most `MAX_PATHS`, failures first; all have one scale.

    Args:
        path: of the PNG.
        title: what the episodes have in common.
        names: of the scenes that the episodes begin with, one or more lines each.
        episodes: finished episodes, as many as `names`.
        world: length of a step, and the two circles.
        scales: at sea, of scenes of other tools, as many as `names`.
        failures: whether to show only failures, larger, with a line at each closest approach.
    """
    ends = Counter(one.outcome for one in episodes)
    order = sorted(range(len(episodes)), key=lambda k: FAILURES.index(episodes[k].outcome))
    order = [k for k in order if not (failures and episodes[k].goal)]
    side, columns, large, small = FAILED if failures else TRIED
    reach = max(float(goal_distance(one.states[0])) / 2 for one in episodes)
    width = 2 * (reach + world.goal_distance + AROUND_PATHS)
    cells: list[Cell] = []
    scales = scales or [None] * len(episodes)
    for one, name, sea in ((episodes[k], names[k], scales[k]) for k in order[:MAX_PATHS]):
        near = f", {one.dcpa:.0f} m" if math.isfinite(one.dcpa) else ""
        end = f"{one.outcome} {one.length * world.dt:.0f} s{near}", small, OUTCOMES[one.outcome]
        lines: list[Line] = [*((line, large, TEXT) for line in name.split("\n")), end]
        if sea is not None:
            at_sea = sea.minutes(one.length * world.dt)
            lines.append((f"{at_sea}, {sea.miles(one.dcpa)}" if near else at_sea, small, FAINT))
        cells.append((draw_paths(one, world, side, width, sea, failures), lines))
    shown = f", {MAX_PATHS} shown" if len(order) > MAX_PATHS else ""
    # The end of a long path says most.
    title = title if len(title) <= MAX_TITLE else f"...{title[-MAX_TITLE:]}"
    header: list[Line] = [(f"{title}: {counted(len(episodes), 'episode')}{shown}", 18, TEXT)]
    header += [(f"{outcome} {ends[outcome]}", 15, OUTCOMES[outcome]) for outcome in FAILURES]
    expected, safe = circle_names(world)
    footer = [
        f"north up, width {width:.0f} m; a dot a step, a larger one every ten; ships where the episode ends",
        f"captions: end, time, least distance; blue: goal, {expected}; around own ship: {safe}",
    ]
    footer += ["yellow: the closest approach" + _width_at_sea(width, scales)] * failures
    _write_page(path, cells, columns, footer, header)


def _write_page(
    path: Path,
    cells: Sequence[Cell],
    columns: int,
    footer: Sequence[str],
    header: Sequence[Line] = (),
    letters: int = 13,
) -> None:
    """Write square pictures in rows with captions below them, a header in one line, and lines of a footer."""
    side = cells[0][0].get_width()
    width = 2 * MARGIN + columns * (side + GAP) - GAP
    footer = [line for text in footer for line in _wrap(text, width - 2 * MARGIN, letters)]
    rows = [cells[k : k + columns] for k in range(0, len(cells), columns)]
    captions = [max(sum(_leading(size) for _, size, _ in lines) for _, lines in row) for row in rows]
    tops = list(accumulate((side + GAP + one for one in captions), initial=MARGIN + 34 * bool(header)))
    page = pen.new_surface(width, tops[-1] + len(footer) * _leading(letters) + MARGIN, BACKGROUND)
    x = float(MARGIN)
    for text, size, colour in header:
        x = pen.write(page, text, (x, MARGIN + 11), colour, size, size > 15) + 20
    for top, row in zip(tops, rows, strict=False):
        for place, (picture, lines) in enumerate(row):
            left, down = MARGIN + place * (side + GAP), float(top + side)
            page.blit(picture, (left, top))
            for line in lines:
                text, size, colour = line
                is_name = line is lines[0] and len(lines) > 1
                at = left, down + _leading(size) / 2
                pen.write(page, pen.cut(text, side, size, is_name, is_name), at, colour, size, is_name)
                down += _leading(size)
    for k, text in enumerate(footer):
        pen.write(page, text, (MARGIN, tops[-1] + (k + 0.5) * _leading(letters)), FAINT, letters)
    pen.save(page, path)


def _width_at_sea(width: float, scales: Scales) -> str:
    """Write the width at sea if it is the same in all scenes."""
    found = {one and one.length for one in scales}
    return f"; width {scales[0].miles(width)} at sea" if len(found) == 1 and scales[0] else ""


def _wrap(text: str, width: float, size: int) -> list[str]:
    """Break a text after semicolons into lines of at most `width` pixels, if its parts are not wider."""
    lines: list[str] = []
    for part in text.split("; "):
        longer = f"{lines[-1]}; {part}" if lines else part
        if lines and pen.width_of(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(part)
    return lines


def _leading(letters: int) -> int:
    return round(1.35 * letters)


def draw_start(
    state: Tensor, world: World, side: int, width: float, sea: Scale | None = None
) -> pygame.Surface:
    """Draw a state [S] as a square of `width` metres; the way of a ship has the colour of its class."""
    telemetry, picture = still(world, state), pen.new_surface(side, side)
    ways = [scene.OWN, *(CLASSES[one][1] for one in encounter_classes(state))]
    paint_scene(
        picture,
        telemetry,
        0.0,
        _frame(state, side, width),
        ways=ways,
        ahead=AHEAD,
        sea=sea,
        labels=side >= LABELLED,
    )
    return picture


def draw_paths(
    episode: Episode,
    world: World,
    side: int,
    width: float,
    sea: Scale | None = None,
    marks_closest: bool = False,
) -> pygame.Surface:
    """Draw an episode's paths as a square of `width` metres; own ship's has the colour of a failure."""
    telemetry, picture = measure_episode(world, episode), pen.new_surface(side, side)
    # Green paths are those of target ships.
    track = scene.OWN if episode.goal else OUTCOMES[episode.outcome]
    frame = _frame(episode.states[0], side, width)
    paint_scene(
        picture, telemetry, telemetry.steps, frame, track=track, ahead=0.0, sea=sea, labels=side >= LABELLED
    )
    if marks_closest and (places := telemetry.closest_places()) is not None:
        ends = [frame.point(*place) for place in places]
        pen.polyline(picture, YELLOW, ends, 2)
        for end in ends:
            pen.circle(picture, YELLOW, end, 3)
    return picture


def _frame(state: Tensor, side: int, width: float) -> Projection:
    """Return a north-up projection around the middle of the way from own ship to the goal in a state [S]."""
    x, y = ((position(state) + goal(state)) / 2).tolist()
    return Projection(x, y, math.pi / 2, side, side / width)


def _reach(state: Tensor) -> float:
    """Return how far (m, along x or y) anything in a state [S] is from the middle of start and goal."""
    ships = target_ships(state)[: int(state[col.SHIP_COUNT]), : col.SHIP_Y + 1]
    middle = (position(state) + goal(state)) / 2
    return float((torch.cat((position(state)[None], ships)) - middle).abs().max())
