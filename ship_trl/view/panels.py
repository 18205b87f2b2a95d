"""What stands beside the scene: the network's view, action, Q-values, return by term, ships; and graphs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pygame
from matplotlib.ticker import MaxNLocator

from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.episode import EpisodeView, Numbers
from ship_trl.view.pen import Point
from ship_trl.view.style import (
    BACKGROUND,
    BAR,
    CHOSEN,
    FAINT,
    HEAT,
    ORANGE,
    OUTCOMES,
    PAIR,
    RULE,
    SERIES,
    SKY,
    TEXT,
    VERMILION,
    YELLOW,
    Colour,
    action_text,
    blend,
    number,
)

# Share of the background over the future.
DIMMED = 0.6
# Lengths of dashes: without colours, lines differ by them.
DASHES = (9.0, 4.0, 14.0, 2.0, 6.0, 20.0)
PAIR_DASHES = (0.0, 9.0)


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
        self.down = float(self.room.top)
        self.is_wide = self.room.width >= 380 * self.unit

    def size(self, pixels: float) -> int:
        """Scale a size of letters."""
        return max(9, round(pixels * self.unit))

    def write(
        self,
        text: str,
        x: float,
        y: float,
        colour: Colour = TEXT,
        pixels: float = 13,
        bold: bool = False,
        across: float = 0.0,
    ) -> float:
        """Write a line with letters of `pixels` before scaling, as `pen.write` does."""
        return pen.write(self.surface, text, (x, y), colour, self.size(pixels), bold, across)

    def head(self, text: str) -> None:
        """Begin a section."""
        self.write(text, self.room.left, self.down + 8 * self.unit, FAINT)
        self.down += 21 * self.unit

    def network_view(self) -> None:
        """Draw what the network sees, and the saliency over it."""
        heat = self.view.salience(self.step) if self.has_saliency else None
        if self.view.sees_numbers:
            self.head("the scene, which the network sees as numbers")
        elif not self.has_saliency:
            self.head(f"network's view, {scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}")
        else:
            self.head("no saliency without a network" if heat is None else "orange: what moves the highest Q")
        available = min(self.room.width, (420 if self.is_wide else 252) * self.unit)
        side = scene.SIZE * max(1, int(available // scene.SIZE))
        box = pygame.Rect(self.room.left, round(self.down), side, side)
        self.surface.blit(pen.from_array(self.view.see(self.step), side), box)
        if heat is not None:
            over = np.empty((*heat.shape, 4), dtype=np.uint8)
            over[..., :3], over[..., 3] = HEAT, (245 * heat).astype(np.uint8)
            glow = pygame.image.frombuffer(over.tobytes(), heat.shape, "RGBA")
            self.surface.blit(pygame.transform.smoothscale(glow, (side, side)), box)
        pygame.draw.rect(self.surface, RULE, box.inflate(2, 2), 1)
        self.down += side + 14 * self.unit

    def action(self) -> None:
        """Write the action of this step."""
        unit, chosen = self.unit, self.numbers.action(self.step)
        self.head("action")
        if chosen is not None:
            speed, turn = self.world.actions[chosen]
            middle = self.down + 14 * unit
            right = self.write(f"a{chosen + 1}", self.room.left, middle, CHOSEN, 28, True) + 14 * unit
            side = "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"
            self.write(side, right, middle - 7 * unit, TEXT, 15, True)
            self.write(f"{speed:g} m/s, {number(turn, 'g')} rad/s", right, middle + 11 * unit, FAINT)
        self.down += 46 * unit

    def values(self) -> None:
        """Write step, time, value, return and distances; in a low room, all in one row."""
        numbers, unit, step = self.numbers, self.unit, self.step
        is_row = self.room.height < 90 * unit
        columns = 6 if is_row else 3 if self.is_wide else 2
        so_far = "" if is_row else " so far"
        q = numbers.q(step)
        # With one decimal: a pass at 45.1 m is no collision, one at 44.9 m is.
        closest = float(numbers.closest[step].min(initial=math.inf))
        too_close = closest < self.world.safe_distance
        entries = (
            ("step", f"{step} of {self.world.max_steps}", TEXT),
            ("time", f"{step * self.world.dt:g} s", TEXT),
            ("value V", "\N{EN DASH}" if q is None else number(float(q.mean()), ".3f"), TEXT),
            (f"return{so_far}", number(float(numbers.total[step]), ".1f"), TEXT),
            ("to the goal", f"{numbers.goal_distance[step]:.0f} m", TEXT),
            (
                f"closest{so_far}",
                "no ships" if closest == math.inf else f"{closest:.1f} m",
                OUTCOMES["collision"] if too_close else TEXT,
            ),
        )
        for k, (name, value, colour) in enumerate(entries):
            x = self.room.left + k % columns * self.room.width / columns
            y = self.down + k // columns * 46 * unit
            self.write(name, x, y + 8 * unit, FAINT, 12 if is_row else 13)
            self.write(value, x, y + 27 * unit, colour, 14 if is_row else 17, True)
        self.down += math.ceil(len(entries) / columns) * 46 * unit + 10 * unit

    def q_values(self) -> None:
        """Draw a bar for each action from the value V to its Q, and mark the chosen action.

        The bar is the advantage. The dueling network subtracts the mean of its advantages, so V is the mean
        of Q. Q differs more between steps than between actions, so each step has its own scale.
        """
        unit, room = self.unit, self.room
        q, chosen = self.numbers.q(self.step), self.numbers.action(self.step)
        count = len(self.world.actions)
        advantage = np.zeros(count) if q is None else q - q.mean()
        pitch = (26 if self.is_wide else 22) * unit
        left = room.left + (190 if self.is_wide else 46) * unit
        right = room.right - 64 * unit
        zero = (left + right) / 2
        scale = (right - left) / 2 / max(1e-6, float(np.abs(advantage).max()))
        self.head("actions (no Q-values)" if self.numbers.q_values is None else "actions")
        if q is not None:
            above = self.down - 13 * unit
            self.write("value V", zero, above, SKY, across=0.5)
            self.write("Q", room.right, above, FAINT, across=1)
        for k in range(count):
            middle, is_chosen = self.down + (k + 0.5) * pitch, k == chosen
            colour = CHOSEN if is_chosen else TEXT
            if is_chosen:
                row = pygame.Rect(0, 0, room.width + 8, round(pitch))
                row.midleft = (room.left - 4, round(middle))
                pygame.draw.rect(self.surface, blend(CHOSEN, BACKGROUND, 0.16), row, border_radius=4)
            name = f"a{k + 1}" + (" \N{BLACK LEFT-POINTING POINTER}" if is_chosen else "")
            self.write(name, room.left, middle, colour, bold=is_chosen)
            if self.is_wide or q is None:
                shade = TEXT if is_chosen else FAINT
                self.write(action_text(self.world, k), room.left + 48 * unit, middle, shade)
            if q is None:
                continue
            end = zero + float(advantage[k]) * scale
            self._bar(zero, end, middle, 0.6 * pitch, CHOSEN if is_chosen else BAR)
            self.write(number(float(q[k]), ".3f"), room.right, middle, colour, bold=is_chosen, across=1)
        if q is not None:
            pygame.draw.aaline(self.surface, SKY, (zero, self.down), (zero, self.down + count * pitch), 2)
        self.down += count * pitch + 18 * unit

    def _bar(self, start: float, end: float, middle: float, height: float, colour: Colour) -> None:
        box = pygame.Rect(0, 0, max(1, round(abs(end - start))), round(height))
        box.midleft = (round(min(start, end)), round(middle))
        pygame.draw.rect(self.surface, colour, box)

    def terms(self) -> None:
        """Draw the return so far, term by term."""
        unit, room = self.unit, self.room
        self.head("return so far, by reward term")
        rows = [*self.numbers.terms.items(), ("total", self.numbers.total)]
        highest = max(1.0, *(float(np.abs(values).max()) for _, values in rows))
        left, right = room.left + 104 * unit, room.right - 78 * unit
        zero, pitch = (left + right) / 2, 26 * unit
        for name, values in rows:
            is_total, value = name == "total", float(values[self.step])
            middle = self.down + pitch / 2
            if is_total:
                pygame.draw.aaline(self.surface, RULE, (room.left, self.down), (room.right, self.down))
            self.write(name, room.left, middle, TEXT, 14, is_total)
            if value:
                colour = TEXT if is_total else SKY if value > 0 else ORANGE
                self._bar(zero, zero + value / highest * (right - left) / 2, middle, 14 * unit, colour)
            self.write(number(value, ".1f"), room.right, middle, TEXT, 14, is_total, 1)
            self.down += pitch
        pygame.draw.aaline(self.surface, FAINT, (zero, self.down - len(rows) * pitch), (zero, self.down))
        self.down += 18 * unit

    def ships(self) -> None:
        """Write each target ship's distance, and how close it comes if all keep course and speed."""
        numbers, step, unit, room = self.numbers, self.step, self.unit, self.room
        count = numbers.ships.shape[1]
        if not count:
            self.head("no target ships")
            return
        about = "; DCPA and TCPA if all keep course and speed" if self.is_wide else ""
        self.head(f"target ships{about}")
        rows = [(("ship", "distance", "closest", "DCPA", "TCPA"), (FAINT,) * 5)]
        for k in range(count):
            time, is_danger = float(numbers.tcpa[step, k]), numbers.is_danger(step, k)
            cells = (
                f"{k + 1}",
                f"{numbers.apart[step, k]:.0f} m",
                f"{numbers.closest[step, k]:.1f} m",
                f"{'! ' if is_danger else ''}{numbers.dcpa[step, k]:.0f} m",
                f"{time:.0f} s" if time > 0 else "passed",
            )
            warning = YELLOW if is_danger else TEXT
            rows.append((cells, (scene.TARGET, TEXT, TEXT, warning, warning)))
        columns = (0, 1, 2, 3, 4) if self.is_wide else (0, 1, 3, 4)
        # Eight ships in a small window are closer together.
        pitch = min((26 if self.is_wide else 22) * unit, (room.bottom - self.down) / len(rows))
        size = min(self.size(14 if self.is_wide else 13), max(9, round(pitch * 0.72)))
        first = (40 if self.is_wide else 30) * unit
        gap = (room.width - first) / (len(columns) - 1)
        for cells, colours in rows:
            for place, k in enumerate(columns):
                at = (room.left + first + gap * place, self.down + pitch / 2)
                is_bold = colours[k] in (scene.TARGET, YELLOW)
                pen.write(self.surface, cells[k], at, colours[k], size, is_bold, across=1)
            self.down += pitch
        self.down += 10 * unit


@dataclass(frozen=True)
class Line:
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
        values = [float(value) for line in lines for value in line.values if math.isfinite(value)]
        low, high = min([0.0, *values]), max([1.0, *values])
        left, top = round(4.2 * size), round(1.9 * size)
        self.room = pygame.Rect(left, top, box.width - round(4.9 * size), box.height - round(3.9 * size))
        count = max(2, self.room.height // round(2.2 * size))
        ticks = [float(tick) for tick in MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)]
        self.low, self.high = min(low, ticks[0]), max(high, ticks[-1])
        self.drawn = pen.new_surface(*box.size, BACKGROUND)
        self._draw_axes(ticks, size)
        x = pen.write(self.drawn, title, (0, 0.7 * size), TEXT, size, True) + size
        self._draw_lines(lines, x, size)

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

    def _draw_axes(self, ticks: Sequence[float], size: int) -> None:
        drawn, room = self.drawn, self.room
        for value in ticks:
            left, down = self.place(0, value)
            pygame.draw.aaline(drawn, RULE, (left, down), (room.right, down))
            pen.write(drawn, number(value, "g"), (left - 6, down), FAINT, size, across=1)
        below = room.bottom + 0.5 * size + 5
        for step in range(0, self.steps + 1, 10 if self.steps <= 100 else 100):
            right, down = self.place(step, self.low)
            pygame.draw.aaline(drawn, RULE, (right, down), (right, down + 4))
            # Leave room for the word at the end.
            if right < room.right - 3.5 * size:
                pen.write(drawn, f"{step}", (right, below), FAINT, size, across=0.5)
        pen.write(drawn, "step", (room.right, below), FAINT, size, across=1)

    def _draw_lines(self, lines: Sequence[Line], x: float, size: int) -> None:
        """Draw the lines, and their legend from `x` on; in a narrow graph its letters are smaller."""
        names = [pen.cut(line.name, 0.4 * self.box.width, size) for line in lines]
        needed = sum(pen.width_of(name, size) + 4 * size for name in names)
        small = max(8, min(size, int(size * (self.box.width - x) / needed)))
        for line, name in zip(lines, names, strict=True):
            places = [self.place(step, float(value)) for step, value in enumerate(line.values)]
            sample = [(x, 0.7 * size), (x + 2.6 * small, 0.7 * size)]
            for points in (places, sample):
                pen.polyline(self.drawn, line.colour, points, line.width, line.dash)
            x = pen.write(self.drawn, name, (x + 3 * small, 0.7 * size), line.colour, small) + small


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
        for view, name, colour, dash in zip(views, "AB", PAIR, PAIR_DASHES, strict=True):
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
