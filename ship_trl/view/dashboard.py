"""Draw the whole picture of one episode or two: header, scenes with their legends, panels, graphs, help.

Parts that change only with the step are cached; each frame draws only the scenes and the marks in the graphs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import pygame

from ship_trl.view import pen
from ship_trl.view.episode import EpisodeView
from ship_trl.view.painter import draw_legend, map_frame, paint_scene, relative_frame
from ship_trl.view.panels import Graph, Panel, make_graphs
from ship_trl.view.style import BACKGROUND, CHOSEN, FAINT, PAIR, TEXT

Columns = tuple[tuple[Callable[[Panel], None], ...], ...]
Views = tuple[EpisodeView, ...]
Size = tuple[int, int]
# The columns beside a scene: of one episode; in a narrow window, or of each of two episodes; and in a window
# too small for graphs.
WIDE: Columns = (
    (Panel.network_view, Panel.q_values),
    (Panel.action, Panel.values, Panel.terms, Panel.ships),
)
NARROW: Columns = ((Panel.network_view, Panel.q_values, Panel.ships),)
SMALL: Columns = ((Panel.network_view, Panel.values), (Panel.action, Panel.q_values, Panel.ships))
# The sizes in which `unit` is 1; other windows scale the same layout.
WIDE_SIZE, NARROW_SIZE, SMALL_SIZE = (1600, 900), (800, 900), (920, 520)
# A window is narrow below this ratio of width to height, and small below this share of the wide size.
NARROW_SHAPE, SMALL_SHARE = 1.3, 0.6


@dataclass(frozen=True)
class Look:
    """What to show: own ship in the middle, hulls as large as the network sees them, saliency."""

    relative: bool = False
    large: bool = False
    saliency: bool = False


class Layout:
    """Divides a window into a lane for each of `count` episodes, and a strip of graphs if there is room.

    `unit` scales all lengths.
    """

    def __init__(self, size: Size, count: int) -> None:
        is_narrow = count > 1 or size[0] < NARROW_SHAPE * size[1]
        share = min(size[0] / WIDE_SIZE[0], size[1] / WIDE_SIZE[1])
        is_small = not is_narrow and share < SMALL_SHARE
        self.columns = NARROW if is_narrow else SMALL if is_small else WIDE
        whole = NARROW_SIZE if is_narrow else SMALL_SIZE if is_small else WIDE_SIZE
        self.unit = unit = max(0.3, min(size[0] / whole[0] / count, size[1] / whole[1]))
        self.pad, head, graphs = round(14 * unit), round(46 * unit), 0 if is_small else round(166 * unit)
        self.title = round(30 * unit) if count > 1 else 0
        self.legend = round((66 if is_narrow or unit < 0.75 else 44) * unit)
        # A narrow layout has a row of values below the legend.
        self.values = round(58 * unit) if is_narrow else 0
        least = round((284 if is_narrow else 446 if is_small else 840) * unit)
        self.width = (size[0] - self.pad * (count + 1)) // count
        self.top = head + self.title
        bottom = size[1] - graphs - self.pad // 2
        self.strip = pygame.Rect(self.pad, bottom, size[0] - 2 * self.pad, graphs)
        room = bottom - self.top - self.legend - self.values - self.pad
        self.side = min(room, self.width - least - self.pad)

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
        paint_scene(surface.subsurface(layout.scene(k)), view.telemetry, position, frame, look.large)
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
    surface, layout = pen.new_surface(*size, BACKGROUND), Layout(size, len(views))
    unit = layout.unit
    _draw_header(surface, views, status, unit)
    for k, (view, step) in enumerate(zip(views, steps, strict=True)):
        scene, beside, letters = layout.scene(k), layout.panel(k), round(19 * unit)
        if len(views) > 1:
            words = pen.cut(f"{'AB'[k]}  {view.title}", layout.width, letters, True)
            pen.write(surface, words, (scene.left, scene.top - layout.title / 2), PAIR[k], letters, True)
        legend = pygame.Rect(scene.bottomleft, (layout.side, layout.legend))
        draw_legend(surface, legend, view.telemetry.world, max(9, round(13 * unit)), look.large)
        if layout.values:
            row = pygame.Rect(legend.bottomleft, (layout.side, layout.values))
            Panel(surface, row, unit, view, step, look.saliency).values()
        gap, count = round(28 * unit), len(layout.columns)
        width = (beside.width - gap * (count - 1)) // count
        for column, sections in enumerate(layout.columns):
            room = pygame.Rect(beside.left + column * (width + gap), beside.top, width, beside.height)
            panel = Panel(surface, room, unit, view, step, look.saliency)
            for draw in sections:
                draw(panel)
    return surface


@lru_cache(1)
def _make_graphs(size: Size, views: Views) -> list[Graph]:
    """Make the graphs; a small picture has none."""
    layout = Layout(size, len(views))
    return make_graphs(views, layout.strip, layout.unit) if layout.strip.height else []


def _draw_header(surface: pygame.Surface, views: Views, status: str, unit: float) -> None:
    """Write case, title and ideal path at the left, and the status at the right."""
    case, middle, size, small = views[0].telemetry.case, 24 * unit, round(19 * unit), round(15 * unit)
    right = surface.get_width() - 14 * unit
    pen.write(surface, status, (right, middle), CHOSEN, small, True, across=1)
    edge = right - 14 * unit - pen.width_of(status, small, True)
    x = pen.write(surface, f"case {case.name}", (14 * unit, middle), TEXT, size, True) + 16 * unit
    if len(views) == 1:
        title = pen.cut(views[0].title, 0.7 * (edge - x), size, True)
        x = pen.write(surface, title, (x, middle), CHOSEN, size, True) + 16 * unit
    path = pen.cut(f"ideal path: {case.ideal_path}", edge - x, round(14 * unit))
    pen.write(surface, path, (x, middle), FAINT, round(14 * unit))


def _draw_help(surface: pygame.Surface, lines: Sequence[tuple[str, str]], unit: float) -> None:
    """Draw a box with the keys over everything."""
    size, pitch = max(10, round(17 * unit)), 28 * unit
    left = max(pen.width_of(key, size, True) for key, _ in lines)
    width = left + max(pen.width_of(what, size) for _, what in lines) + 80 * unit
    box = pygame.Rect(0, 0, width, (len(lines) + 1) * pitch + 24 * unit)
    box.center = surface.get_rect().center
    pygame.draw.rect(surface, BACKGROUND, box, border_radius=round(10 * unit))
    pygame.draw.rect(surface, CHOSEN, box, 2, border_radius=round(10 * unit))
    y = box.top + 12 * unit + pitch / 2
    pen.write(surface, "Keys", (box.left + 28 * unit, y), TEXT, round(19 * unit), True)
    for key, what in lines:
        y += pitch
        pen.write(surface, key, (box.left + 28 * unit, y), CHOSEN, size, True)
        pen.write(surface, what, (box.left + 52 * unit + left, y), TEXT, size)
