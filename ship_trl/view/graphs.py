"""Graphs of return and distances over the steps of an episode, or of two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pygame
from matplotlib.ticker import MaxNLocator

from ship_trl.view import pen
from ship_trl.view.episode import EpisodeView, Numbers
from ship_trl.view.pen import Point
from ship_trl.view.style import BACKGROUND, FAINT, RULE, SERIES, TEXT, VERMILION, Colour, number, pair_colours

# Share of the background over the future.
DIMMED = 0.6
# Lengths of dashes: without colours, lines differ by them.
DASHES = (9.0, 4.0, 14.0, 2.0, 6.0, 20.0)
PAIR_DASHES = (0.0, 9.0)


class Line(NamedTuple):
    """A line of a graph, with a value for each step."""

    name: str
    values: Numbers
    colour: Colour
    dash: float = 0.0
    width: int = 2


class Graph:
    """A graph in `box`, drawn once; `draw` dims the future. `steps` is the end of its axis."""

    def __init__(self, title: str, lines: Sequence[Line], steps: int, box: pygame.Rect, size: int) -> None:
        self.box, self.steps = box, max(1, steps)
        self.drawn = drawn = pen.new_surface(*box.size, BACKGROUND)
        values = np.concatenate([line.values[np.isfinite(line.values)] for line in lines])
        low, high = min(0.0, *values), max(1.0, *values)
        left, top = round(4.2 * size), round(1.9 * size)
        self.room = room = pygame.Rect(
            left, top, box.width - round(4.9 * size), box.height - round(3.9 * size)
        )
        count = max(2, room.height // round(2.2 * size))
        ticks = [float(tick) for tick in MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)]
        self.low, self.high = min(low, ticks[0]), max(high, ticks[-1])
        for value in ticks:
            start, down = self.place(0, value)
            pygame.draw.aaline(drawn, RULE, (start, down), (room.right, down))
            pen.write(drawn, number(value, "g"), (start - 6, down), FAINT, size, across=1)
        below = room.bottom + 0.5 * size + 5
        for step in range(0, self.steps + 1, 10 if self.steps <= 100 else 100):
            right, down = self.place(step, self.low)
            pygame.draw.aaline(drawn, RULE, (right, down), (right, down + 4))
            # Leave room for the word at the end.
            if right < room.right - 3.5 * size:
                pen.write(drawn, f"{step}", (right, below), FAINT, size, across=0.5)
        pen.write(drawn, "step", (room.right, below), FAINT, size, across=1)
        x = pen.write(drawn, title, (0, 0.7 * size), TEXT, size, True) + size
        # In a narrow graph the letters of the legend are smaller, and long names are cut.
        names, room_left = [line.name for line in lines], box.width - x
        widths = (
            (small, sum(pen.width_of(name, small) + 4 * small for name in names))
            for small in range(size, 7, -1)
        )
        small = next((small for small, needed in widths if needed <= room_left), 0)
        if not small:
            small, share = 8, room_left / len(names) - 32
            names = [pen.cut(name, share, small) for name in names]
        for line, name in zip(lines, names, strict=True):
            places = [self.place(step, float(value)) for step, value in enumerate(line.values)]
            sample = [(x, 0.7 * size), (x + 2.6 * small, 0.7 * size)]
            for points in (places, sample):
                pen.polyline(drawn, line.colour, points, line.width, line.dash)
            x = pen.write(drawn, name, (x + 3 * small, 0.7 * size), line.colour, small) + small

    def place(self, step: float, value: float) -> Point:
        """Return the pixel of a value at a step, from the corner of the box."""
        room = self.room
        share = (value - self.low) / (self.high - self.low)
        return room.left + room.width * step / self.steps, room.bottom - room.height * share

    def step_at(self, at: tuple[int, int]) -> int | None:
        """Return the step at a place of the window, or None outside the graph."""
        if not self.box.collidepoint(at) or at[1] < self.box.top + self.room.top:
            return None
        share = (at[0] - self.box.left - self.room.left) / self.room.width
        return round(min(max(share, 0.0), 1.0) * self.steps)

    def draw(self, surface: pygame.Surface, step: float) -> None:
        """Draw it with its mark at a step."""
        surface.blit(self.drawn, self.box)
        room = self.room.move(self.box.topleft)
        x = self.box.left + self.place(min(step, self.steps), 0.0)[0]
        veil = pen.new_surface(room.right + 2 - round(x), room.height, BACKGROUND)
        veil.set_alpha(round(255 * DIMMED))
        surface.blit(veil, (round(x), room.top))
        pygame.draw.aaline(surface, TEXT, (x, room.top), (x, room.bottom))


def make_graphs(views: Sequence[EpisodeView], strip: pygame.Rect, unit: float) -> list[Graph]:
    """Make the graphs of return and distances side by side in a strip, for one episode or two."""
    first = views[0].telemetry
    is_finished = all(view.telemetry.outcome for view in views)
    steps = max(view.telemetry.steps for view in views) if is_finished else first.world.max_steps
    returns, distances = [], []
    if len(views) == 1:
        returns.append(Line("total", first.total, TEXT, width=3))
        terms = [(name, values) for name, values in first.terms.items() if values.any()]
        distances.append(Line("goal", first.goal_distance, TEXT, width=3))
        prefix = "ship " if first.apart.shape[1] < 5 else ""
        ships = [(f"{prefix}{k}", values) for k, values in enumerate(first.apart.T, 1)]
        for lines, named in ((returns, terms), (distances, ships)):
            for k, (name, values) in enumerate(named):
                lines.append(Line(name, values, SERIES[k % len(SERIES)], DASHES[k % len(DASHES)]))
    else:
        colours = pair_colours([view.title for view in views])
        for view, name, colour, dash in zip(views, "AB", colours, PAIR_DASHES, strict=True):
            numbers = view.telemetry
            returns.append(Line(f"{name} {view.title}", numbers.total, colour, dash, 3))
            distances.append(Line(f"{name} to goal", numbers.goal_distance, colour, dash, 3))
            if numbers.apart.shape[1]:
                distances.append(Line(f"{name} nearest ship", numbers.apart.min(1), colour, dash or 2.0, 1))
    if first.apart.shape[1]:
        level = np.full(steps + 1, first.world.safe_distance)
        distances.append(Line("safe distance", level, VERMILION, 3.0, 1))
    size = max(9, round(12 * unit))
    left = pygame.Rect(strip.topleft, ((strip.width - round(24 * unit)) // 2, strip.height))
    right = left.move(strip.width - left.width, 0)
    return [
        Graph("return so far", returns, steps, left, size),
        Graph("distance, m", distances, steps, right, size),
    ]
