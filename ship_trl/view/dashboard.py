"""A whole picture of one episode or two: header, scenes with their legends, panels, graphs, help.

What changes only from step to step is drawn once a step and kept; at each frame only the ships and the
marks in the graphs are drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pygame

from ship_trl.view import pen
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.graph import Graph, make_graphs
from ship_trl.view.legend import draw_legend
from ship_trl.view.painter import absolute_frame, paint_scene
from ship_trl.view.palette import BACKGROUND, CHOSEN, FAINT, PAIR, TEXT
from ship_trl.view.panel import Panel

Columns = tuple[tuple[Callable[[Panel], None], ...], ...]
# What stands beside the scene, column by column: of one episode, of one in a narrow window or of each of
# two, and of one in a picture too small for graphs.
WIDE: Columns = (
    (Panel.network_view, Panel.q_values),
    (Panel.action, Panel.values, Panel.terms, Panel.ships),
)
NARROW: Columns = ((Panel.network_view, Panel.q_values, Panel.ships),)
SMALL: Columns = ((Panel.network_view, Panel.values), (Panel.action, Panel.q_values, Panel.ships))
# The sizes for which they are laid out; other windows have the same, larger or smaller.
WIDE_SIZE, NARROW_SIZE, SMALL_SIZE = (1600, 900), (800, 900), (920, 520)
# A window narrower than this many times its height is narrow; one smaller than this share of the wide size
# is small.
NARROW_SHAPE, SMALL_SHARE = 1.3, 0.6


@dataclass(frozen=True)
class Look:
    """How it is shown: the frame, hulls to scale, where the network looks."""

    absolute: bool = False
    to_scale: bool = False
    saliency: bool = False


@dataclass(frozen=True)
class Lane:
    """Where one episode is shown; `values` is a strip below the legend, in a narrow layout."""

    title: pygame.Rect
    scene: pygame.Rect
    legend: pygame.Rect
    values: pygame.Rect | None
    panel: pygame.Rect


class Layout:
    """Divides a window between `count` episodes: a lane for each, and a strip of graphs where there is room.

    `unit` is the scale of everything: 1 in a window of the size for which its columns are laid out.
    """

    def __init__(self, size: tuple[int, int], count: int) -> None:
        is_narrow = count > 1 or size[0] < NARROW_SHAPE * size[1]
        share = min(size[0] / WIDE_SIZE[0], size[1] / WIDE_SIZE[1])
        is_small = not is_narrow and share < SMALL_SHARE
        self.columns = NARROW if is_narrow else SMALL if is_small else WIDE
        whole = NARROW_SIZE if is_narrow else SMALL_SIZE if is_small else WIDE_SIZE
        self.unit = unit = max(0.3, min(size[0] / whole[0] / count, size[1] / whole[1]))
        pad, head, graphs = round(14 * unit), round(46 * unit), 0 if is_small else round(166 * unit)
        title = round(30 * unit) if count > 1 else 0
        legend = round((66 if is_narrow or unit < 0.75 else 44) * unit)
        values = round(58 * unit) if is_narrow else 0
        least = round((284 if is_narrow else 446 if is_small else 840) * unit)
        width = (size[0] - pad * (count + 1)) // count
        top = head + title
        self.strip = pygame.Rect(pad, size[1] - graphs - pad // 2, size[0] - 2 * pad, graphs)
        side = min(self.strip.top - top - legend - values - pad, width - least - pad)
        self.lanes = []
        for k in range(count):
            left = pad + k * (width + pad)
            below = pygame.Rect(left, top + side, side, legend)
            beside = left + side + pad
            self.lanes.append(
                Lane(
                    pygame.Rect(left, head, width, title),
                    pygame.Rect(left, top, side, side),
                    below,
                    pygame.Rect(below.bottomleft, (side, values)) if values else None,
                    pygame.Rect(beside, top, left + width - beside, self.strip.top - pad - top),
                )
            )


class Dashboard:
    """Draws episodes on a surface of any size; `draw` is quick enough for every frame."""

    def __init__(self) -> None:
        self._still_key: tuple[object, ...] = ()
        self._still = pen.new_surface(1, 1)
        self._graphs_key: tuple[object, ...] = ()
        self._graphs: list[tuple[Graph, tuple[int, int]]] = []

    def draw(
        self,
        surface: pygame.Surface,
        views: Sequence[EpisodeView],
        position: float,
        look: Look,
        status: str = "",
        help_lines: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Draw one episode, or two beside each other, over all of a surface.

        Args:
            surface: where they go.
            views: one, or two of the same case.
            position: steps from the start, whole or between two.
            look: how.
            status: one line, top right.
            help_lines: keys and what they do; drawn over everything where there are any.
        """
        layout = Layout(surface.get_size(), len(views))
        # Positions are sums of fractions: a step that has begun counts as begun.
        steps = tuple(min(int(position + 1e-9), view.telemetry.steps) for view in views)
        key = (surface.get_size(), tuple(map(id, views)), steps, look.to_scale, look.saliency, status)
        if key != self._still_key:
            self._still = pen.new_surface(*surface.get_size())
            self._draw_still(layout, views, steps, look, status)
            self._still_key = key
        surface.blit(self._still, (0, 0))
        telemetries = [view.telemetry for view in views]
        for telemetry, lane in zip(telemetries, layout.lanes, strict=True):
            frame = absolute_frame(telemetries, lane.scene.width) if look.absolute else None
            paint_scene(surface.subsurface(lane.scene), telemetry, position, frame, look.to_scale)
        self._place_graphs(views, layout)
        for graph, corner in self._graphs:
            graph.draw(surface, corner, position)
        if help_lines:
            draw_help(surface, help_lines, layout.unit)

    def step_at(self, place: tuple[int, int]) -> int | None:
        """Find the step that a place in a graph stands for; None outside the graphs."""
        for graph, corner in self._graphs:
            across, down = place[0] - corner[0], place[1] - corner[1]
            if 0 <= across < graph.size[0] and graph.room.top <= down < graph.size[1]:
                return graph.step_at(across)
        return None

    def _draw_still(
        self, layout: Layout, views: Sequence[EpisodeView], steps: Sequence[int], look: Look, status: str
    ) -> None:
        """Draw all but the scenes and the graphs."""
        surface, unit = self._still, layout.unit
        surface.fill(BACKGROUND)
        draw_header(surface, views, status, unit)
        for k, (view, step, lane) in enumerate(zip(views, steps, layout.lanes, strict=True)):
            if len(views) > 1:
                size = round(19 * unit)
                words = pen.cut(f"{'AB'[k]}  {view.title}", lane.title.width, size, True)
                pen.write(surface, words, lane.title.midleft, PAIR[k], size, True)
            letters = max(9, round(13 * unit))
            draw_legend(surface, lane.legend, view.telemetry.world, letters, look.to_scale)
            if lane.values:
                Panel(surface, lane.values, unit, view, step, look.saliency).values()
            gap, count = round(28 * unit), len(layout.columns)
            width = (lane.panel.width - gap * (count - 1)) // count
            for column, sections in enumerate(layout.columns):
                left = lane.panel.left + column * (width + gap)
                room = pygame.Rect(left, lane.panel.top, width, lane.panel.height)
                panel = Panel(surface, room, unit, view, step, look.saliency)
                for draw in sections:
                    draw(panel)

    def _place_graphs(self, views: Sequence[EpisodeView], layout: Layout) -> None:
        """Make the graphs anew for other episodes or another size."""
        strip = layout.strip
        key = (strip.size, tuple(map(id, views)))
        if key != self._graphs_key:
            self._graphs, self._graphs_key = [], key
            if strip.height:
                width = (strip.width - round(24 * layout.unit)) // 2
                graphs = make_graphs(views, (width, strip.height), max(9, round(12 * layout.unit)))
                corners = ((strip.left, strip.top), (strip.right - width, strip.top))
                self._graphs = list(zip(graphs, corners, strict=True))


def draw_header(surface: pygame.Surface, views: Sequence[EpisodeView], status: str, unit: float) -> None:
    """Write case, title and ideal path at the top left, and the status at the top right."""
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
    pygame.draw.rect(surface, BACKGROUND, box, border_radius=round(10 * unit))
    pygame.draw.rect(surface, CHOSEN, box, 2, border_radius=round(10 * unit))
    y = box.top + 12 * unit + pitch / 2
    pen.write(surface, "Keys", (box.left + 28 * unit, y), TEXT, round(19 * unit), True)
    for key, what in lines:
        y += pitch
        pen.write(surface, key, (box.left + 28 * unit, y), CHOSEN, size, True)
        pen.write(surface, what, (box.left + 52 * unit + left, y), TEXT, size)
