"""The whole window: header, game pictures with their legends, panels, graphs, help.

What changes only from step to step is drawn once a step and kept; at each frame only the ships and the
marks in the graphs are drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pygame

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view.lettering import CHOSEN, FAINT, INK, PAPER, RULE
from ship_trl.viewer import pen
from ship_trl.viewer.graph import LANES, Graph, graphs_of
from ship_trl.viewer.panel import Panel
from ship_trl.viewer.sea import TRUE_LENGTH, absolute_frame, draw_sea
from ship_trl.viewer.show import Show

# The size for which everything is laid out; other windows have the same, larger or smaller.
SIZE = (1600, 900)
# A window narrower than this many times its height.
NARROW = 1.3


@dataclass(frozen=True)
class Look:
    """How it is shown: the frame, hulls to scale, where the network looks."""

    absolute: bool = False
    to_scale: bool = False
    saliency: bool = False


@dataclass(frozen=True)
class Lane:
    """Where one episode is shown."""

    title: pygame.Rect
    sea: pygame.Rect
    caption: pygame.Rect
    panel: pygame.Rect


class Dashboard:
    """Draws episodes on a surface of any size; `draw` is quick enough for every frame."""

    def __init__(self) -> None:
        self._kept: tuple[object, ...] = ()
        self._still = pygame.Surface((1, 1))
        self._drawn_on: pygame.Surface | None = None
        self._of_graphs: tuple[object, ...] = ()
        self._placed: list[tuple[Graph, tuple[int, int]]] = []

    def draw(
        self,
        surface: pygame.Surface,
        shows: Sequence[Show],
        position: float,
        look: Look,
        status: str = "",
        help_lines: Sequence[tuple[str, str]] = (),
    ) -> list[pygame.Rect]:
        """Draw one episode, or two beside each other; returns the parts of the surface that have changed.

        On the surface that it drew on last it draws no more than these.

        Args:
            surface: all of it is drawn over; nobody else may draw on it between two calls.
            shows: one, or two of the same case.
            position: steps from the start, whole or between two.
            look: how.
            status: one line, top right.
            help_lines: keys and what they do; drawn over everything where there are any.
        """
        size = surface.get_size()
        # In a window that is not wide one episode is shown as each of two is in a wide one.
        narrow = len(shows) > 1 or size[0] < NARROW * size[1]
        across = SIZE[0] * (0.5 if narrow and len(shows) == 1 else 1.0)
        unit = max(0.3, min(size[0] / across, size[1] / SIZE[1]))
        lanes, strip = layout(size, unit, len(shows), narrow)
        steps = tuple(min(int(position), show.telemetry.steps) for show in shows)
        kept = (size, tuple(map(id, shows)), steps, look.to_scale, look.saliency, status)
        if kept != self._kept:
            self._still = pygame.Surface(size, depth=32)
            self._draw_still(shows, steps, look, status, unit, lanes, narrow)
            self._kept = kept
            self._drawn_on = None
        whole = surface is not self._drawn_on or bool(help_lines)
        if whole:
            surface.blit(self._still, (0, 0))
        # What lies over everything has to be wiped out next time.
        self._drawn_on = None if help_lines else surface
        together = tuple(show.telemetry for show in shows)
        for show, lane in zip(shows, lanes, strict=True):
            frame = absolute_frame(together, lane.sea.width) if look.absolute else None
            draw_sea(surface.subsurface(lane.sea), show.telemetry, position, frame, look.to_scale)
        self._draw_graphs(surface, shows, strip, position, unit)
        if help_lines:
            draw_help(surface, help_lines, unit)
        return [surface.get_rect()] if whole else [*(lane.sea for lane in lanes), strip]

    def step_at(self, place: tuple[int, int]) -> int | None:
        """Tell which step a place in a graph stands for; None outside the graphs."""
        for graph, corner in self._placed:
            across, down = place[0] - corner[0], place[1] - corner[1]
            if 0 <= across < graph.size[0] and graph.room.top <= down < graph.size[1]:
                return graph.step_at(across)
        return None

    def _draw_still(
        self,
        shows: Sequence[Show],
        steps: Sequence[int],
        look: Look,
        status: str,
        unit: float,
        lanes: Sequence[Lane],
        narrow: bool,
    ) -> None:
        surface = self._still
        surface.fill(PAPER)
        size = round(19 * unit)
        case, middle = shows[0].telemetry.case, 24 * unit
        edge = pen.write(
            surface, status, (surface.get_width() - 14 * unit, middle), CHOSEN, round(15 * unit), True, 1
        )
        edge = surface.get_width() - 28 * unit - pen.width_of(status, round(15 * unit), True)
        x = pen.write(surface, f"case {case.name}", (14 * unit, middle), INK, size, True) + 16 * unit
        if len(shows) == 1:
            title = pen.cut(shows[0].title, 0.6 * (edge - x), size, True)
            x = pen.write(surface, title, (x, middle), CHOSEN, size, True) + 16 * unit
        path = pen.cut(f"ideal path: {case.ideal_path}", edge - x, round(14 * unit))
        pen.write(surface, path, (x, middle), FAINT, round(14 * unit))
        for k, (show, step, lane) in enumerate(zip(shows, steps, lanes, strict=True)):
            if len(shows) > 1:
                words = pen.cut(f"{'AB'[k]}  {show.title}", lane.title.width, size, True)
                pen.write(surface, words, lane.title.midleft, LANES[k][0], size, True)
            draw_caption(surface, lane.caption, show.telemetry.world, look.to_scale, unit)
            if narrow:
                below = pygame.Rect(lane.caption.bottomleft, lane.caption.size)
                Panel(surface, below, unit).numbers(show, step, columns=6)
                one = Panel(surface, lane.panel, unit)
                one.view(show, step, look.saliency)
                one.q_values(show, step)
                one.ships(show, step)
                continue
            first, second = halves(lane.panel, unit)
            seen = Panel(surface, first, unit)
            seen.view(show, step, look.saliency)
            seen.q_values(show, step)
            told = Panel(surface, second, unit)
            told.action(show, step)
            told.numbers(show, step)
            told.terms(show, step)
            told.ships(show, step)

    def _draw_graphs(
        self, surface: pygame.Surface, shows: Sequence[Show], strip: pygame.Rect, position: float, unit: float
    ) -> None:
        width = (strip.width - round(24 * unit)) // 2
        kept = (strip.size, tuple(map(id, shows)))
        if kept != self._of_graphs:
            graphs = graphs_of(shows, (width, strip.height), max(9, round(12 * unit)))
            corners = ((strip.left, strip.top), (strip.right - width, strip.top))
            self._placed = list(zip(graphs, corners, strict=True))
            self._of_graphs = kept
        for graph, corner in self._placed:
            graph.draw(surface, corner, position)


def layout(size: tuple[int, int], unit: float, count: int, narrow: bool) -> tuple[list[Lane], pygame.Rect]:
    """Divide a window between `count` episodes: their lanes, and the strip of the graphs."""
    width, height = size
    pad, head, graphs = round(14 * unit), round(46 * unit), round(166 * unit)
    title = round(30 * unit) if count > 1 else 0
    caption = round((66 if narrow or unit < 0.75 else 44) * unit)
    numbers = round(58 * unit) if narrow else 0
    least = round((284 if narrow else 840) * unit)
    lane_width = (width - pad * (count + 1)) // count
    side = min(height - head - graphs - title - caption - numbers - pad - pad // 2, lane_width - least - pad)
    strip = pygame.Rect(pad, height - graphs - pad // 2, width - 2 * pad, graphs)
    lanes = []
    for k in range(count):
        left, top = pad + k * (lane_width + pad), head + title
        beside = left + side + pad
        bottom = strip.top - pad
        lanes.append(
            Lane(
                pygame.Rect(left, head, lane_width, title),
                pygame.Rect(left, top, side, side),
                pygame.Rect(left, top + side, side, caption),
                pygame.Rect(beside, top, left + lane_width - beside, bottom - top),
            )
        )
    return lanes, strip


def halves(room: pygame.Rect, unit: float) -> tuple[pygame.Rect, pygame.Rect]:
    """Divide a panel into two columns."""
    gap = round(28 * unit)
    width = (room.width - gap) // 2
    return (
        pygame.Rect(room.left, room.top, width, room.height),
        pygame.Rect(room.right - width, room.top, width, room.height),
    )


def draw_caption(
    surface: pygame.Surface, room: pygame.Rect, world: World, to_scale: bool, unit: float
) -> None:
    """Explain what is drawn in the picture, and how long its ships are."""
    size = max(9, round(13 * unit))
    if to_scale:
        hulls = f"hulls to scale, {TRUE_LENGTH:g} m; outline: as drawn for the network"
    else:
        hulls = (
            f"hulls larger than life: {scene.OWN_LENGTH:g} and {scene.TARGET_LENGTH:g} m, "
            f"truly {TRUE_LENGTH:g} m"
        )
    items = (
        (scene.OWN, "ship", "own ship"),
        (scene.TARGET, "ship", "target ships"),
        (scene.GOAL_CIRCLE, "disc", f"expected distance {world.goal_distance:g} m"),
        (scene.SAFE_CIRCLE, "disc", f"safe distance {world.safe_distance:g} m"),
        (scene.LINE, "line", "to the goal"),
        (scene.OWN, "dots", f"track, {world.dt:g} s apart"),
        (None, "", hulls),
    )
    x, y = float(room.left), room.top + 0.95 * size
    for colour, shape, words in items:
        sample = 1.9 * size if colour else 0
        needed = sample + pen.width_of(words, size)
        if x > room.left and x + needed > room.right:
            x, y = float(room.left), y + 1.5 * size
        if colour:
            draw_sample(surface, colour, shape, (x + 0.7 * size, y), size)
        x = pen.write(
            surface,
            pen.cut(words, room.right - x - sample, size),
            (x + sample, y),
            INK if colour else CHOSEN,
            size,
        )
        x += 1.1 * size


def draw_sample(surface: pygame.Surface, colour: pen.Colour, shape: str, at: pen.Point, size: int) -> None:
    """Draw a thing of the picture small, for the legend."""
    x, y = at
    if shape == "ship":
        corners = [(x - v, y - u) for u, v in scene.ship_outline(1.15 * size)]
        pen.polygon(surface, colour, corners)
    elif shape == "disc":
        pen.circle(surface, RULE, at, 0.55 * size + 1)
        pen.circle(surface, colour, at, 0.55 * size)
    elif shape == "line":
        pen.line(surface, colour, (x - 0.6 * size, y + 0.4 * size), (x + 0.6 * size, y - 0.4 * size), 2)
    else:
        for k in (-1, 0, 1):
            pen.circle(surface, colour, (x + 0.5 * k * size, y), 0.13 * size)


def draw_help(surface: pygame.Surface, lines: Sequence[tuple[str, str]], unit: float) -> None:
    """List the keys in a box over everything."""
    size, pitch = max(10, round(17 * unit)), 28 * unit
    left = max(pen.width_of(key, size, True) for key, _ in lines)
    width = left + max(pen.width_of(what, size) for _, what in lines) + 80 * unit
    box = pygame.Rect(0, 0, width, (len(lines) + 1) * pitch + 24 * unit)
    box.center = surface.get_rect().center
    shade = pygame.Surface(surface.get_size(), pygame.SRCALPHA)
    shade.fill((0, 0, 0, 150))
    surface.blit(shade, (0, 0))
    pygame.draw.rect(surface, PAPER, box, border_radius=round(10 * unit))
    pygame.draw.rect(surface, CHOSEN, box, 2, border_radius=round(10 * unit))
    y = box.top + 12 * unit + pitch / 2
    pen.write(surface, "Keys", (box.left + 28 * unit, y), INK, round(19 * unit), True)
    for key, what in lines:
        y += pitch
        pen.write(surface, key, (box.left + 28 * unit, y), CHOSEN, size, True)
        pen.write(surface, what, (box.left + 52 * unit + left, y), INK, size)
