"""What stands beside the game picture: the network's view, Q-values, return by term, the ships."""

from __future__ import annotations

import math

import numpy as np
import pygame

from ship_trl.config.types import World
from ship_trl.sim import scene
from ship_trl.view.lettering import BAR, CHOSEN, FAINT, INK, OUTCOMES, PAPER, RULE, number
from ship_trl.viewer import pen
from ship_trl.viewer.show import Show
from ship_trl.viewer.telemetry import nearest_danger, split

# Of the saliency: seen on every grey.
HEAT = (255, 150, 0)


class Panel:
    """Draws sections one below the other in a column.

    Args:
        surface: where they go.
        room: the column.
        unit: pixels of what is one pixel at 1600 x 900.
    """

    def __init__(self, surface: pygame.Surface, room: pygame.Rect, unit: float) -> None:
        self.surface, self.room, self.unit = surface, room, unit
        self.down = float(room.top)
        self.wide = room.width >= 380 * unit

    def size(self, pixels: float) -> int:
        """Give the size of letters."""
        return max(9, round(pixels * self.unit))

    def head(self, text: str) -> None:
        """Begin a section."""
        pen.write(self.surface, text, (self.room.left, self.down + 8 * self.unit), FAINT, self.size(13))
        self.down += 21 * self.unit

    def view(self, show: Show, step: int, salient: bool) -> None:
        """Draw what the network sees, and where it looks."""
        unit, room = self.unit, self.room
        heat = show.salience(step) if salient else None
        pixels = f"{scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE} pixels"
        if not salient:
            self.head(f"what the network sees, {pixels}" if self.wide else f"network's view, {pixels}")
        elif heat is None:
            self.head("no saliency: this policy is no network")
        else:
            self.head("orange: on what the highest Q depends" + " most" * self.wide)
        most = min(room.width, (420 if self.wide else 252) * unit)
        side = scene.SIZE * max(1, int(most // scene.SIZE))
        seen = show.see(step)
        flat = np.ascontiguousarray(np.moveaxis(np.broadcast_to(seen, (3, *seen.shape[1:])), 0, -1))
        picture = pygame.image.frombuffer(flat.tobytes(), (scene.SIZE, scene.SIZE), "RGB")
        box = pygame.Rect(room.left, round(self.down), side, side)
        self.surface.blit(pygame.transform.scale(picture, (side, side)), box)
        if heat is not None:
            over = np.empty((scene.SIZE, scene.SIZE, 4), dtype=np.uint8)
            over[..., :3], over[..., 3] = HEAT, (245 * heat).astype(np.uint8)
            glow = pygame.image.frombuffer(over.tobytes(), (scene.SIZE, scene.SIZE), "RGBA")
            self.surface.blit(pygame.transform.smoothscale(glow, (side, side)), box)
        pygame.draw.rect(self.surface, RULE, box.inflate(2, 2), 1)
        self.down += side + 14 * unit

    def action(self, show: Show, step: int) -> None:
        """Write the action taken now, or how the episode ended."""
        unit, left = self.unit, self.room.left
        numbers, chosen = show.telemetry, show.telemetry.action(step)
        if chosen is None:
            self.head("outcome" if numbers.outcome else "action")
            word = (numbers.outcome or "your turn").upper()
            colour = OUTCOMES.get(numbers.outcome or "", INK)
            pen.write(self.surface, word, (left, self.down + 14 * unit), colour, self.size(28), True)
        else:
            self.head("action")
            middle = self.down + 14 * unit
            speed, turn = numbers.world.actions[chosen]
            end = pen.write(self.surface, f"a{chosen + 1}", (left, middle), CHOSEN, self.size(28), True)
            beside = end + 14 * unit
            pen.write(self.surface, side_of(turn), (beside, middle - 7 * unit), INK, self.size(15), True)
            words = f"{speed:g} m/s, {number(turn, 'g')} rad/s"
            pen.write(self.surface, words, (beside, middle + 11 * unit), FAINT, self.size(13))
        self.down += 46 * unit

    def numbers(self, show: Show, step: int, columns: int = 3) -> None:
        """Write step, time, value and distances, so many beside each other."""
        numbers, unit = show.telemetry, self.unit
        q = numbers.q(step)
        entries = (
            ("step", f"{step} of {numbers.world.max_steps}"),
            ("time", f"{step * numbers.world.dt:g} s"),
            ("value V", "\N{EN DASH}" if q is None else number(float(split(q)[0]), ".3f")),
            ("return so far" if columns == 3 else "return", number(float(numbers.total[step]), ".1f")),
            ("to the goal", f"{numbers.goal_distance[step]:.0f} m"),
            ("episode", show.episode or "1"),
        )
        for k, (what, value) in enumerate(entries):
            x = self.room.left + k % columns * self.room.width / columns
            y = self.down + k // columns * 46 * unit
            pen.write(self.surface, what, (x, y + 8 * unit), FAINT, self.size(13 if columns == 3 else 12))
            pen.write(
                self.surface, value, (x, y + 27 * unit), INK, self.size(17 if columns == 3 else 14), True
            )
        self.down += math.ceil(len(entries) / columns) * 46 * unit + 10 * unit

    def q_values(self, show: Show, step: int) -> None:
        """Draw a bar for each action from the value to its Q: its advantage. The chosen one is marked.

        Q changes far more in the course of an episode than between actions, so each step has its own scale.
        """
        numbers, unit, surface = show.telemetry, self.unit, self.surface
        q, world, chosen = numbers.q(step), numbers.world, numbers.action(step)
        count, size = len(world.actions), self.size(13)
        pitch = (26 if self.wide else 22) * unit
        left = self.room.left + (190 if self.wide else 46) * unit
        right = self.room.right - (150 if self.wide else 64) * unit
        end = self.room.right - (84 * unit if self.wide else 0)
        title = "Q of each action" if self.wide else "actions"
        self.head(title if numbers.q_values is not None else "actions (no Q-values)")
        head = self.down - 13 * unit
        if q is not None:
            pen.write(surface, "value V", ((left + right) / 2, head), pen.SKY, size, across=0.5)
            pen.write(surface, "Q", (end, head), FAINT, size, across=1)
            if self.wide:
                word = "advantage" if pen.width_of("advantage", size) < 70 * unit else "adv."
                pen.write(surface, word, (self.room.right, head), FAINT, size, across=1)
        ahead = np.zeros(count) if q is None else split(q)[1]
        scale = (right - left) / 2 / max(1e-6, float(np.abs(ahead).max()))
        zero = (left + right) / 2
        for k in range(count):
            middle, mine = self.down + (k + 0.5) * pitch, k == chosen
            colour = CHOSEN if mine else INK
            if mine:
                ground = pygame.Rect(0, 0, self.room.width + 8, round(pitch))
                ground.midleft = (self.room.left - 4, round(middle))
                pygame.draw.rect(surface, pen.blend(CHOSEN, PAPER, 0.16), ground, border_radius=4)
            name = f"a{k + 1}" + (" \N{BLACK LEFT-POINTING POINTER}" if mine else "")
            pen.write(surface, name, (self.room.left, middle), colour, size, mine)
            if self.wide or q is None:
                words = action_words(world, k)
                pen.write(surface, words, (self.room.left + 48 * unit, middle), INK if mine else FAINT, size)
            if q is None:
                continue
            self._bar(zero, zero + float(ahead[k]) * scale, middle, 0.6 * pitch, CHOSEN if mine else BAR)
            pen.write(surface, number(float(q[k]), ".3f"), (end, middle), colour, size, mine, across=1)
            if self.wide:
                text = signed(float(ahead[k]))
                pen.write(surface, text, (self.room.right, middle), colour, size, mine, across=1)
        if q is not None:
            pen.line(surface, pen.SKY, (zero, self.down), (zero, self.down + count * pitch), 2)
        self.down += count * pitch + 18 * unit

    def _bar(self, start: float, end: float, middle: float, height: float, colour: pen.Colour) -> None:
        """Draw a bar from one place to another, in whichever direction."""
        box = pygame.Rect(0, 0, max(1, round(abs(end - start))), round(height))
        box.midleft = (round(min(start, end)), round(middle))
        pygame.draw.rect(self.surface, colour, box)

    def terms(self, show: Show, step: int) -> None:
        """Draw the return so far, term by term."""
        numbers, unit, room = show.telemetry, self.unit, self.room
        self.head("return so far, by reward term")
        rows = [*numbers.terms.items(), ("total", numbers.total)]
        most = max(1.0, *(float(np.abs(values).max()) for _, values in rows))
        left, right = room.left + 104 * unit, room.right - 78 * unit
        zero, pitch, size = (left + right) / 2, 26 * unit, self.size(14)
        for name, values in rows:
            total, value = name == "total", float(values[step])
            middle = self.down + pitch / 2
            if total:
                pen.line(self.surface, RULE, (room.left, self.down), (room.right, self.down))
            pen.write(self.surface, name, (room.left, middle), INK, size, total)
            colour = INK if total else pen.SKY if value > 0 else pen.ORANGE
            if value:
                self._bar(zero, zero + value / most * (right - left) / 2, middle, 14 * unit, colour)
            pen.write(self.surface, number(value, ".1f"), (room.right, middle), INK, size, total, across=1)
            self.down += pitch
        pen.line(self.surface, FAINT, (zero, self.down - len(rows) * pitch), (zero, self.down))
        self.down += 18 * unit

    def ships(self, show: Show, step: int) -> None:
        """Write of each target ship how far it is, and how near it will come if all keep course and speed."""
        numbers, unit, room = show.telemetry, self.unit, self.room
        count = len(numbers.case.target_ships)
        if not count:
            self.head("no target ships")
            return
        self.head("target ships; DCPA and TCPA if all keep course and speed" if self.wide else "target ships")
        columns = ["ship", "distance", "DCPA", "TCPA"]
        if self.wide:
            columns.insert(2, "closest")
        # As many rows as there is room for: eight ships in a small window are closer together.
        pitch = min((26 if self.wide else 22) * unit, (room.bottom - self.down) / (count + 1))
        size = min(self.size(14 if self.wide else 13), max(9, round(pitch * 0.72)))
        first = 40 * unit
        gap = (room.width - first) / (len(columns) - 1)
        ends = [room.left + first + gap * k for k in range(len(columns))]
        for end, word in zip(ends, columns, strict=True):
            pen.write(self.surface, word, (end, self.down + pitch / 2), FAINT, size, across=1)
        for k, danger in enumerate(nearest_danger(numbers, step)):
            self.down += pitch
            time = float(numbers.tcpa[step, k])
            cells = {
                "ship": f"{k + 1}",
                "distance": f"{numbers.apart[step, k]:.0f} m",
                "closest": f"{numbers.closest[step, k]:.1f} m",
                "DCPA": ("! " if danger else "") + f"{numbers.dcpa[step, k]:.0f} m",
                "TCPA": f"{time:.0f} s" if time > 0 else "passed",
            }
            for end, word in zip(ends, columns, strict=True):
                warned = danger and word in ("DCPA", "TCPA")
                colour = pen.YELLOW if warned else scene.TARGET if word == "ship" else INK
                bold = warned or word == "ship"
                at = (end, self.down + pitch / 2)
                pen.write(self.surface, cells[word], at, colour, size, bold, across=1)
        self.down += pitch + 10 * unit


def side_of(turn: float) -> str:
    """Say to which side a rate of turn leads."""
    return "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"


def action_words(world: World, action: int) -> str:
    """Describe an action: speed, and turn as an arrow with its size."""
    speed, turn = world.actions[action]
    if turn == 0:
        return f"{speed:g} m/s \N{UPWARDS ARROW}"
    port, starboard = "\N{ANTICLOCKWISE OPEN CIRCLE ARROW}", "\N{CLOCKWISE OPEN CIRCLE ARROW}"
    return f"{speed:g} m/s {port if turn > 0 else starboard} {abs(turn):g}"


def signed(value: float) -> str:
    """Write an advantage with its sign."""
    text = number(value, ".3f")
    return f"+{text}" if value > 0.0005 else text
