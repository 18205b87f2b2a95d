"""Graphs over the steps of an episode: the past bright, what is to come faint, a mark at the present step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pygame
from matplotlib.ticker import MaxNLocator

from ship_trl.view import pen
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.palette import BACKGROUND, FAINT, PAIR, RULE, SERIES, TEXT, VERMILION, Colour
from ship_trl.view.pen import Point
from ship_trl.view.telemetry import Numbers
from ship_trl.view.words import number

# Share of the background over what is to come.
DIMMED = 0.6
# Lengths of dashes, which tell lines apart without colour.
DASHES = (9.0, 4.0, 14.0, 2.0, 6.0, 20.0)
PAIR_DASHES = (0.0, 9.0)


@dataclass(frozen=True)
class Line:
    """A line of a graph: a value for each step from 0 on."""

    name: str
    values: Numbers
    colour: Colour
    dash: float = 0.0
    width: int = 2


class Graph:
    """A graph drawn in advance; `draw` dims what is to come at any step.

    `steps` is the end of its axis, `letters` their size in pixels.
    """

    def __init__(
        self, title: str, lines: Sequence[Line], steps: int, size: tuple[int, int], letters: int
    ) -> None:
        self.size, self.steps, self.letters = size, max(1, steps), letters
        values = [float(value) for line in lines for value in line.values if math.isfinite(value)]
        low, high = min([0.0, *values]), max([1.0, *values])
        left, top = round(4.2 * letters), round(1.9 * letters)
        self.room = pygame.Rect(left, top, size[0] - round(4.9 * letters), size[1] - round(3.9 * letters))
        count = max(2, self.room.height // round(2.2 * letters))
        self.ticks = [float(tick) for tick in MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)]
        self.low, self.high = min(low, self.ticks[0]), max(high, self.ticks[-1])
        self.drawn = self._draw(title, lines)

    def place(self, step: float, value: float) -> Point:
        """Find the pixels of a value at a step."""
        room = self.room
        share = (value - self.low) / (self.high - self.low)
        return room.left + room.width * step / self.steps, room.bottom - room.height * share

    def step_at(self, across: float) -> int:
        """Find the step that is `across` pixels from the left."""
        share = (across - self.room.left) / self.room.width
        return round(min(max(share, 0.0), 1.0) * self.steps)

    def draw(self, surface: pygame.Surface, at: tuple[int, int], step: float) -> None:
        """Draw it on a surface, with its mark at a step."""
        surface.blit(self.drawn, at)
        room = self.room.move(at)
        x = at[0] + self.place(min(step, self.steps), 0.0)[0]
        veil = pen.new_surface(room.right + 2 - round(x), room.height)
        veil.fill(BACKGROUND)
        veil.set_alpha(round(255 * DIMMED))
        surface.blit(veil, (round(x), room.top))
        pen.line(surface, TEXT, (x, room.top), (x, room.bottom))

    def _draw(self, title: str, lines: Sequence[Line]) -> pygame.Surface:
        """Draw axes, lines and legend."""
        drawn, room, size = pen.new_surface(*self.size), self.room, self.letters
        drawn.fill(BACKGROUND)
        for value in self.ticks:
            left, down = self.place(0, value)
            pen.line(drawn, RULE, (left, down), (room.right, down))
            pen.write(drawn, number(value, "g"), (left - 6, down), FAINT, size, across=1)
        below = room.bottom + 0.5 * size + 5
        for step in range(0, self.steps + 1, 10 if self.steps <= 100 else 100):
            right, down = self.place(step, self.low)
            pen.line(drawn, RULE, (right, down), (right, down + 4))
            # The axis ends with a word.
            if right < room.right - 3.5 * size:
                pen.write(drawn, f"{step}", (right, below), FAINT, size, across=0.5)
        pen.write(drawn, "step", (room.right, below), FAINT, size, across=1)
        x = pen.write(drawn, title, (0, 0.7 * size), TEXT, size, True) + size
        # In a narrow graph the legend has smaller letters.
        names = [pen.cut(line.name, 0.4 * self.size[0], size) for line in lines]
        needed = sum(pen.width_of(name, size) + 4 * size for name in names)
        small = max(8, min(size, int(size * (self.size[0] - x) / needed)))
        for line, name in zip(lines, names, strict=True):
            places = [self.place(step, float(value)) for step, value in enumerate(line.values)]
            pen.polyline(drawn, line.colour, places, line.width, line.dash)
            sample = [(x, 0.7 * size), (x + 2.6 * small, 0.7 * size)]
            pen.polyline(drawn, line.colour, sample, line.width, line.dash)
            x = pen.write(drawn, name, (x + 3 * small, 0.7 * size), line.colour, small) + small
        return drawn


def make_graphs(views: Sequence[EpisodeView], size: tuple[int, int], letters: int) -> list[Graph]:
    """Make the graphs of return and distances, for one episode or two."""
    first = views[0].telemetry
    is_whole = all(view.telemetry.outcome for view in views)
    steps = max(view.telemetry.steps for view in views) if is_whole else first.world.max_steps
    returns, distances = [], []
    if len(views) == 1:
        returns.append(Line("total", first.total, TEXT, width=3))
        paid = [(name, values) for name, values in first.terms.items() if values.any()]
        distances.append(Line("goal", first.goal_distance, TEXT, width=3))
        few = first.apart.shape[1] < 5
        ships = [(f"ship {k}" if few else f"{k}", values) for k, values in enumerate(first.apart.T, 1)]
        for lines, named in ((returns, paid), (distances, ships)):
            for k, (name, values) in enumerate(named):
                lines.append(Line(name, values, SERIES[k % len(SERIES)], DASHES[k % len(DASHES)]))
    else:
        for view, name, colour, dash in zip(views, "AB", PAIR, PAIR_DASHES, strict=True):
            numbers = view.telemetry
            returns.append(Line(f"{name} {view.title}", numbers.total, colour, dash, 3))
            distances.append(Line(f"{name} to goal", numbers.goal_distance, colour, dash, 3))
            if numbers.apart.shape[1]:
                distances.append(Line(f"{name} nearest ship", numbers.apart.min(1), colour, dash or 2.0, 1))
    if first.apart.shape[1]:
        level = np.full(steps + 1, first.world.safe_distance)
        distances.append(Line("safe distance", level, VERMILION, 3.0, 1))
    return [
        Graph("return so far", returns, steps, size, letters),
        Graph("distance, m", distances, steps, size, letters),
    ]
