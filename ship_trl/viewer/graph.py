"""Graphs over the steps of an episode: what is past bright, what is to come faint, a mark where it is now."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pygame

from ship_trl.view.lettering import FAINT, INK, PAPER, RULE, number
from ship_trl.viewer import pen
from ship_trl.viewer.pen import Colour, Point, blend
from ship_trl.viewer.show import Show
from ship_trl.viewer.telemetry import Numbers

TO_COME = 0.38
# Lengths of dashes, which tell lines apart without colour.
DASHES = (9.0, 4.0, 14.0, 2.0, 6.0, 20.0)
LANES = ((pen.SKY, 0.0), (pen.ORANGE, 9.0))


@dataclass(frozen=True)
class Line:
    """A line of a graph: a value for each step from 0 on."""

    name: str
    values: Numbers
    colour: Colour
    dash: float = 0.0
    width: int = 2


class Graph:
    """One graph, drawn twice when it is made; `draw` puts the two together at any step.

    Args:
        title: what it is, with its unit.
        lines: those drawn over the steps.
        steps: to where its axis goes.
        size: width and height in pixels.
        letters: their size.
        level: a value with a line of its own, and its name.
    """

    def __init__(
        self,
        title: str,
        lines: Sequence[Line],
        steps: int,
        size: tuple[int, int],
        letters: int,
        level: tuple[str, float] | None = None,
    ) -> None:
        self.size, self.steps, self.letters = size, max(1, steps), letters
        values = [float(value) for line in lines for value in line.values if math.isfinite(value)]
        low, high = min([0.0, *values]), max([1.0, *values])
        self.room = pygame.Rect(
            round(4.2 * letters),
            round(1.9 * letters),
            size[0] - round(4.9 * letters),
            size[1] - round(3.9 * letters),
        )
        self.ticks = round_values(low, high, max(2, self.room.height // round(2.2 * letters)))
        self.low, self.high = min(low, self.ticks[0]), max(high, self.ticks[-1])
        self.past, self.to_come = (self._drawn(title, lines, level, share) for share in (1.0, TO_COME))

    def place(self, step: float, value: float) -> Point:
        """Pixels of a value at a step."""
        room = self.room
        share = (value - self.low) / (self.high - self.low)
        return room.left + room.width * step / self.steps, room.bottom - room.height * share

    def step_at(self, across: float) -> int:
        """Tell which step is so many pixels from the left."""
        share = (across - self.room.left) / self.room.width
        return round(min(max(share, 0.0), 1.0) * self.steps)

    def draw(self, surface: pygame.Surface, at: tuple[int, int], step: float) -> None:
        """Draw it on a surface, as it stands after so many steps."""
        now = self.place(min(step, self.steps), 0.0)[0]
        surface.blit(self.to_come, at)
        surface.blit(self.past, at, (0, 0, round(now), self.size[1]))
        # Title and legend are as bright on both sides.
        surface.blit(self.past, at, (0, 0, self.size[0], self.room.top))
        x = at[0] + now
        pen.line(surface, INK, (x, at[1] + self.room.top), (x, at[1] + self.room.bottom))

    def _drawn(
        self, title: str, lines: Sequence[Line], level: tuple[str, float] | None, share: float
    ) -> pygame.Surface:
        drawn, room, size = pygame.Surface(self.size, depth=32), self.room, self.letters
        drawn.fill(PAPER)
        for value in self.ticks:
            left, down = self.place(0, value)
            pen.line(drawn, RULE, (left, down), (room.right, down))
            pen.write(drawn, number(value, "g"), (left - 6, down), FAINT, size, across=1)
        for step in range(0, self.steps + 1, 10 if self.steps <= 100 else 100):
            right, down = self.place(step, self.low)
            pen.line(drawn, RULE, (right, down), (right, down + 4))
            # The word below ends where the axis does.
            if right < room.right - 3.5 * size:
                pen.write(drawn, f"{step}", (right, down + 0.5 * size + 5), FAINT, size, across=0.5)
        pen.write(drawn, "step", (room.right, room.bottom + 0.5 * size + 5), FAINT, size, across=1)
        if level:
            lines = [*lines, Line(level[0], np.full(self.steps + 1, level[1]), pen.VERMILION, 3.0, 1)]
        x = pen.write(drawn, title, (0, 0.7 * size), INK, size, True) + size
        # A legend that is too long for a narrow graph has smaller letters.
        names = [pen.cut(line.name, 0.4 * self.size[0], size) for line in lines]
        long = sum(pen.width_of(name, size) + 4 * size for name in names)
        small = max(8, min(size, int(size * (self.size[0] - x) / long)))
        for line, name in zip(lines, names, strict=True):
            colour = blend(line.colour, PAPER, share)
            places = [self.place(step, float(value)) for step, value in enumerate(line.values)]
            pen.polyline(drawn, colour, places, line.width, line.dash)
            sample = [(x, 0.7 * size), (x + 2.6 * small, 0.7 * size)]
            pen.polyline(drawn, line.colour, sample, line.width, line.dash)
            x = pen.write(drawn, name, (x + 3 * small, 0.7 * size), line.colour, small) + small
        return drawn


def round_values(low: float, high: float, count: int) -> list[float]:
    """Give at most about `count` round values that cover from low to high."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
    return [k * step for k in range(math.floor(low / step), math.ceil(high / step) + 1)]


def graphs_of(shows: Sequence[Show], size: tuple[int, int], letters: int) -> list[Graph]:
    """Make the two graphs of one episode or of two: return, and distances."""
    first = shows[0].telemetry
    whole = all(show.telemetry.outcome for show in shows)
    steps = max(show.telemetry.steps for show in shows) if whole else first.world.max_steps
    returns, distances = [], []
    if len(shows) == 1:
        returns.append(Line("total", first.total, INK, width=3))
        paid = [(name, values) for name, values in first.terms.items() if values.any()]
        for k, (name, values) in enumerate(paid):
            returns.append(Line(name, values, pen.SERIES[k % len(pen.SERIES)], DASHES[k % len(DASHES)]))
        distances.append(Line("goal", first.goal_distance, INK, width=3))
        for k, values in enumerate(first.apart.T):
            name = f"ship {k + 1}" if first.apart.shape[1] < 5 else f"{k + 1}"
            distances.append(Line(name, values, pen.SERIES[k % 6], DASHES[k % 6]))
    else:
        for show, name, (colour, dash) in zip(shows, "AB", LANES, strict=True):
            numbers = show.telemetry
            returns.append(Line(f"{name} {show.title}", numbers.total, colour, dash, 3))
            distances.append(Line(f"{name} to goal", numbers.goal_distance, colour, dash, 3))
            if numbers.apart.shape[1]:
                distances.append(Line(f"{name} nearest ship", numbers.apart.min(1), colour, dash or 2.0, 1))
    level = ("safe distance", first.world.safe_distance) if first.apart.shape[1] else None
    return [
        Graph("return so far", returns, steps, size, letters),
        Graph("distance, m", distances, steps, size, letters, level),
    ]
