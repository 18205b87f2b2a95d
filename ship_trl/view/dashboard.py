"""Draw the whole picture of one episode or two: header, scenes with their legends, panels, graphs, help.

Parts that change only with the step are cached; each frame draws only the scenes and the marks in the graphs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pygame

from ship_trl.sim import scene
from ship_trl.view import pen, style
from ship_trl.view.episode import EpisodeView
from ship_trl.view.graphs import Graph, make_graphs
from ship_trl.view.painter import draw_legend, map_frame, paint_scene, relative_frame

Views = tuple[EpisodeView, ...]
Size = tuple[int, int]
# A window is narrow below this ratio of width to height, and small below this share of the wide size.
NARROW_RATIO, SMALL_SHARE = 1.3, 0.67


@dataclass
class Panel:
    """Draws sections one below the other in `room`, for one step of an episode.

    `unit` scales all lengths, and is 1 in a window of 1600 x 900.
    """

    surface: pygame.Surface
    room: pygame.Rect
    unit: float
    view: EpisodeView
    step: int
    has_saliency: bool

    def __post_init__(self) -> None:
        self.numbers, self.world = self.view.telemetry, self.view.telemetry.world
        self.sea = self.view.case.scale
        self.down = float(self.room.top)
        self.is_wide = self.room.width >= 380 * self.unit

    def write(
        self, text: str, x: float, y: float, colour: style.Colour, bold: bool = False, across: float = 0.0
    ) -> None:
        """Write a line in small letters, as `pen.write` does."""
        pen.write(self.surface, text, (x, y), colour, max(9, round(13 * self.unit)), bold, across)

    def head(self, text: str) -> None:
        """Begin a section."""
        words = pen.cut(text, self.room.width, max(9, round(13 * self.unit)))
        self.write(words, self.room.left, self.down + 8 * self.unit, style.FAINT)
        self.down += 21 * self.unit

    def network_view(self) -> None:
        """Draw what the network sees, and the saliency over it."""
        heat = self.view.salience(self.step) if self.has_saliency else None
        if self.view.sees_numbers:
            self.head("the scene, seen as numbers")
        elif not self.has_saliency:
            self.head(f"network's view, {scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}")
        else:
            self.head("no saliency without a network" if heat is None else "orange: what moves the highest Q")
        available = min(self.room.width, (420 if self.is_wide else 252) * self.unit)
        side = scene.SIZE * max(1, int(available // scene.SIZE))
        box = pygame.Rect(self.room.left, round(self.down), side, side)
        self.surface.blit(pen.from_array(self.view.see(self.step).cpu().numpy(), side), box)
        if heat is not None:
            over = np.empty((*heat.shape, 4), dtype=np.uint8)
            over[..., :3], over[..., 3] = style.HEAT, (245 * heat).astype(np.uint8)
            glow = pygame.image.frombuffer(over.tobytes(), heat.shape, "RGBA")
            self.surface.blit(pygame.transform.smoothscale(glow, (side, side)), box)
        pygame.draw.rect(self.surface, style.RULE, box.inflate(2, 2), 1)
        self.down += side + 14 * self.unit

    def length(self, metres: float, decimals: int) -> str:
        """Write a length, of a scene of another tool also at sea."""
        words = f"{metres:.{decimals}f} m"
        return words if self.sea is None else f"{words}, {self.sea.miles(metres)}"

    def values(self) -> None:
        """Write the action of this step, the time, the value, the return and distances."""
        numbers, world, step = self.numbers, self.world, self.step
        chosen, q = numbers.action(step), numbers.q(step)
        items = [(style.TEXT, f"step {step} of {world.max_steps}, {step * world.dt:g} s")]
        if chosen is not None:
            speed, turn = world.actions[chosen]
            side = "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"
            told = f"{speed:g} m/s" if self.sea is None else f"{speed:g} m/s, {self.sea.knots(speed)}"
            does = f"a{chosen + 1}, {side}", f"{told}, {style.number(turn, 'g')} rad/s"
            items = [*((style.CHOSEN, words) for words in does), *items]
        if q is not None:
            items.append((style.TEXT, f"value V {style.number(float(q.mean()), '.3f')}"))
        items.append((style.TEXT, f"return so far {style.number(float(numbers.total[step]), '.1f')}"))
        items.append((style.TEXT, f"{self.length(float(numbers.goal_distance[step]), 0)} to the goal"))
        if numbers.ships.size:
            closest = float(numbers.closest[step].min())
            # With one decimal: a pass at 45.1 m is no collision, one at 44.9 m is.
            is_danger = closest < world.safe_distance
            colour = style.DANGER if is_danger else style.TEXT
            items.append((colour, f"closest so far {self.length(closest, 1)}"))
        room = pygame.Rect(self.room.left, self.down, self.room.width, 0)
        self.down = pen.flow(self.surface, items, room, max(9, round(15 * self.unit)))

    def q_values(self) -> None:
        """Draw a bar for each action from the value V to its Q, and mark the chosen action.

        The bar is the advantage. The dueling network subtracts the mean of its advantages, so V is the mean
        of Q. Q differs more between steps than between actions, so each step has its own scale.
        """
        unit, room = self.unit, self.room
        q, chosen = self.numbers.q(self.step), self.numbers.action(self.step)
        pitch, left = (26 * unit, 190 * unit) if self.is_wide else (22 * unit, 46 * unit)
        half = (room.width - 64 * unit - left) / 2
        zero, bottom = room.left + left + half, self.down + 21 * unit + len(self.world.actions) * pitch
        self.head("actions (no Q-values)" if self.numbers.q_values is None else "actions")
        for k in range(len(self.world.actions)):
            middle, is_chosen = self.down + (k + 0.5) * pitch, k == chosen
            colour = style.CHOSEN if is_chosen else style.TEXT
            if is_chosen:
                row = pygame.Rect(0, 0, room.width + 8, round(pitch))
                row.midleft = (room.left - 4, round(middle))
                shade = style.blend(style.CHOSEN, style.BACKGROUND, 0.16)
                pygame.draw.rect(self.surface, shade, row, border_radius=4)
            name = f"a{k + 1}" + (" \N{BLACK LEFT-POINTING POINTER}" if is_chosen else "")
            self.write(name, room.left, middle, colour, bold=is_chosen)
            if self.is_wide or q is None:
                shade = style.TEXT if is_chosen else style.FAINT
                self.write(style.action_text(self.world, k), room.left + 48 * unit, middle, shade)
            if q is not None:
                end = zero + half * float(q[k] - q.mean()) / max(1e-6, float(np.abs(q - q.mean()).max()))
                box = pygame.Rect(0, 0, max(1, round(abs(end - zero))), round(0.6 * pitch))
                box.midleft = (round(min(zero, end)), round(middle))
                pygame.draw.rect(self.surface, style.CHOSEN if is_chosen else style.BAR, box)
                told = style.number(float(q[k]), ".3f")
                self.write(told, room.right, middle, colour, bold=is_chosen, across=1)
        if q is not None:
            self.write("value V", zero, self.down - 13 * unit, style.SKY, across=0.5)
            self.write("Q", room.right, self.down - 13 * unit, style.FAINT, across=1)
            pygame.draw.aaline(self.surface, style.SKY, (zero, self.down), (zero, bottom), 2)
        self.down = bottom + 18 * unit

    def ships(self) -> None:
        """Write each target ship's distance, and how close it comes if all keep course and speed.

        Of a scene of another tool these are miles and minutes at sea, with the speed in place of the closest.
        """
        numbers, step, unit, room, sea = self.numbers, self.step, self.unit, self.room, self.sea
        count = numbers.ships.shape[1]
        if not count:
            self.head("no target ships")
            return
        about = "; DCPA and TCPA if all keep course and speed" if self.is_wide else ""
        self.head(f"target ships{'' if sea is None else ', NM at sea'}{about}")
        third = "closest" if sea is None else "speed"
        rows = [(("ship" if self.is_wide else "", "distance", third, "DCPA", "TCPA"), (style.FAINT,) * 5)]
        for k in range(count):
            time, is_danger = float(numbers.tcpa[step, k]), numbers.is_danger(step, k)
            apart, dcpa = float(numbers.apart[step, k]), float(numbers.dcpa[step, k])
            told = f"{apart:.0f} m", f"{numbers.closest[step, k]:.1f} m", f"{dcpa:.0f} m", f"{time:.0f} s"
            if sea is not None:
                speed = sea.knots(float(numbers.speeds[step, k]))
                # The head of the section has the unit.
                miles, nearest = (sea.miles(one).removesuffix(" NM") for one in (apart, dcpa))
                told = miles, speed, nearest, sea.minutes(time)
            near, third, pass_at, left = told
            warned = f"{'! ' if is_danger else ''}{pass_at}"
            cells = (f"{k + 1}", near, third, warned, left if time > 0 else "passed")
            warning = style.YELLOW if is_danger else style.TEXT
            rows.append((cells, (scene.TARGET, style.TEXT, style.TEXT, warning, warning)))
        columns = (0, 1, 2, 3, 4) if self.is_wide else (0, 1, 3, 4)
        pitch, size, first = (26, 14, 40) if self.is_wide else (22, 13, 30)
        gap = (room.width - first * unit) / (len(columns) - 1)
        # Eight ships in a small window are closer together.
        low = min(pitch * unit, (room.bottom - self.down) / len(rows))
        letters = max(9, min(round(size * unit), round(low * 0.72)))
        for cells, colours in rows:
            for place, k in enumerate(columns):
                at = (room.left + first * unit + gap * place, self.down + low / 2)
                is_bold = colours[k] in (scene.TARGET, style.YELLOW)
                pen.write(self.surface, cells[k], at, colours[k], letters, is_bold, across=1)
            self.down += low


class Arrangement(NamedTuple):
    """What stands where in a window; lengths in pixels of a window of `size`.

    `columns` are sections beside a scene, together at least `beside` wide; the heights are of a legend, of a
    row of values below it, and of the graphs, or 0.
    """

    size: Size
    columns: tuple[tuple[Callable[[Panel], None], ...], ...]
    beside: int
    legend: int
    values: int
    graphs: int


COLUMNS = (Panel.network_view, Panel.values), (Panel.q_values, Panel.ships)
# Of one episode; in a narrow window, or of each of two episodes; and in a window too small for graphs.
WIDE = Arrangement((1600, 900), COLUMNS, 840, 44, 0, 166)
NARROW = Arrangement((800, 900), ((Panel.network_view, Panel.q_values, Panel.ships),), 284, 66, 48, 166)
SMALL = Arrangement((920, 520), COLUMNS, 446, 44, 0, 0)


@dataclass(frozen=True)
class Look:
    """What to show: own ship in the middle, hulls as large as the network sees them, saliency; maps alone."""

    relative: bool = False
    large: bool = False
    saliency: bool = False
    maps: bool = False


class Layout:
    """Divides a window into a lane for each of `count` episodes, and a strip of graphs if there is room.

    `unit` scales all lengths.
    """

    def __init__(self, size: Size, count: int) -> None:
        share = min(size[0] / WIDE.size[0], size[1] / WIDE.size[1])
        self.kind = kind = SMALL if share < SMALL_SHARE else WIDE
        if count > 1 or size[0] < NARROW_RATIO * size[1]:
            self.kind = kind = NARROW
        self.unit = unit = max(0.3, min(size[0] / kind.size[0] / count, size[1] / kind.size[1]))
        self.pad, graphs = round(14 * unit), round(kind.graphs * unit)
        # Readable at the width of a phone, where there is room.
        self.title = round((56 if unit > 0.5 else 30) * unit) if count > 1 else 0
        # Small letters are relatively wider, so the legend has more lines.
        self.legend = round((66 if unit < 0.75 else kind.legend) * unit)
        self.values = round(kind.values * unit)
        self.width = (size[0] - self.pad * (count + 1)) // count
        self.top = round(46 * unit) + self.title
        bottom = size[1] - graphs - self.pad // 2
        self.strip = pygame.Rect(self.pad, bottom, size[0] - 2 * self.pad, graphs)
        room = bottom - self.top - self.legend - self.values - self.pad
        self.side = min(room, self.width - round(kind.beside * unit) - self.pad)

    def scene(self, lane: int) -> pygame.Rect:
        """Return the place of a scene; its legend is below."""
        return pygame.Rect(self.pad + lane * (self.width + self.pad), self.top, self.side, self.side)

    def panel(self, lane: int) -> pygame.Rect:
        """Return the place beside a scene."""
        left, width = self.scene(lane).right + self.pad, self.width - self.side - self.pad
        return pygame.Rect(left, self.top, width, self.strip.top - self.pad - self.top)


def draw_dashboard(
    surface: pygame.Surface,
    views: Sequence[EpisodeView],
    position: float,
    look: Look,
    status: str = "",
    help_lines: Sequence[tuple[str, str]] = (),
) -> None:
    """Draw one episode, or two of the same case, over a whole surface.

    `position` is in steps; `status` is written at the top right; `help_lines` are keys and what they do.
    """
    size, some = surface.get_size(), tuple(views)
    layout = Layout(size, len(some))
    # Positions are sums of fractions: a step that has begun counts as begun.
    steps = tuple(min(int(position + 1e-9), view.telemetry.steps) for view in some)
    surface.blit(_draw_still(size, some, steps, look, status), (0, 0))
    telemetries = [view.telemetry for view in some]
    for k, view in enumerate(some):
        frame = map_frame(telemetries, layout.side)
        if look.relative:
            frame = relative_frame(view.telemetry.at(position)[0], layout.side)
        place = layout.scene(k)
        sea = view.case.scale
        paint_scene(surface.subsurface(place), view.telemetry, position, frame, look.large, sea=sea)
        legend, letters = pygame.Rect(place.bottomleft, (layout.side, layout.legend)), round(13 * layout.unit)
        draw_legend(surface, legend, view.telemetry.world, max(9, letters), frame.scale, look.large)
    for graph in _make_graphs(size, some):
        graph.draw(surface, position)
    if help_lines:
        _draw_help(surface, help_lines, layout.unit)


def step_at(size: Size, views: Sequence[EpisodeView], place: tuple[int, int]) -> int | None:
    """Return the step at a place in a graph, or None outside the graphs."""
    steps = (graph.step_at(place) for graph in _make_graphs(size, tuple(views)))
    return next((step for step in steps if step is not None), None)


@lru_cache(1)
def _draw_still(size: Size, views: Views, steps: tuple[int, ...], look: Look, status: str) -> pygame.Surface:
    """Draw everything but the scenes and the graphs."""
    surface, layout = pen.new_surface(*size, style.BACKGROUND), Layout(size, len(views))
    unit, colours = layout.unit, style.pair_colours([view.title for view in views])
    _draw_header(surface, views, status, unit)
    for k, (view, step) in enumerate(zip(views, steps, strict=True)):
        scene, beside, letters = layout.scene(k), layout.panel(k), round(0.65 * layout.title)
        if len(views) > 1:
            words = pen.cut(f"{'AB'[k]}  {view.title}", layout.width, letters, True)
            pen.write(surface, words, (scene.left, scene.top - layout.title / 2), colours[k], letters, True)
        if layout.values:
            row = pygame.Rect(scene.left, scene.bottom + layout.legend, layout.side, layout.values)
            Panel(surface, row, unit, view, step, look.saliency).values()
        gap, count = round(28 * unit), len(layout.kind.columns)
        width = (beside.width - gap * (count - 1)) // count
        for column, sections in enumerate(layout.kind.columns):
            room = pygame.Rect(beside.left + column * (width + gap), beside.top, width, beside.height)
            panel = Panel(surface, room, unit, view, step, look.saliency)
            for draw in sections:
                # In a comparison a planner has no network whose view could be shown.
                if draw is not Panel.network_view or view.network is not None or len(views) == 1:
                    draw(panel)
    return surface


@lru_cache(1)
def _make_graphs(size: Size, views: Views) -> list[Graph]:
    """Make the graphs; a small picture has none."""
    layout = Layout(size, len(views))
    return make_graphs(views, layout.strip, layout.unit) if layout.strip.height else []


def _draw_header(surface: pygame.Surface, views: Views, status: str, unit: float) -> None:
    """Write case, title, and ideal path or scale at sea at the left, and the status at the right."""
    case, middle, size, small = views[0].case, 24 * unit, round(19 * unit), round(15 * unit)
    right = surface.get_width() - 14 * unit
    pen.write(surface, status, (right, middle), style.CHOSEN, small, True, across=1)
    edge = right - 14 * unit - pen.width_of(status, small, True)
    x = pen.write(surface, f"case {case.name}", (14 * unit, middle), style.TEXT, size, True) + 16 * unit
    if len(views) == 1:
        title = pen.cut(views[0].title, 0.7 * (edge - x), size, True)
        x = pen.write(surface, title, (x, middle), style.CHOSEN, size, True) + 16 * unit
    about = f"ideal path: {case.ideal_path}"
    if case.scale is not None:
        about = f"at sea: {case.scale.describe(views[0].telemetry.world)}"
    about = pen.cut(about, edge - x, round(14 * unit))
    pen.write(surface, about, (x, middle), style.FAINT, round(14 * unit))


def _draw_help(surface: pygame.Surface, lines: Sequence[tuple[str, str]], unit: float) -> None:
    """Draw a box with the keys over everything."""
    size, pitch = max(10, round(17 * unit)), 28 * unit
    left = max(pen.width_of(key, size, True) for key, _ in lines)
    width = left + max(pen.width_of(what, size) for _, what in lines) + 80 * unit
    box = pygame.Rect(0, 0, width, (len(lines) + 1) * pitch + 24 * unit)
    box.center = surface.get_rect().center
    pygame.draw.rect(surface, style.BACKGROUND, box, border_radius=round(10 * unit))
    pygame.draw.rect(surface, style.CHOSEN, box, 2, border_radius=round(10 * unit))
    y = box.top + 12 * unit + pitch / 2
    pen.write(surface, "Keys", (box.left + 28 * unit, y), style.TEXT, round(19 * unit), True)
    for key, what in lines:
        y += pitch
        pen.write(surface, key, (box.left + 28 * unit, y), style.CHOSEN, size, True)
        pen.write(surface, what, (box.left + 52 * unit + left, y), style.TEXT, size)
