"""What stands beside the scene: the network's view, the action, Q-values, returns by term, target ships."""

from __future__ import annotations

import math

import numpy as np
import pygame

from ship_trl.sim import scene
from ship_trl.view import pen
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.palette import (
    BACKGROUND,
    BAR,
    CHOSEN,
    FAINT,
    HEAT,
    ORANGE,
    OUTCOMES,
    RULE,
    SKY,
    TEXT,
    YELLOW,
    Colour,
    blend,
)
from ship_trl.view.words import action_text, number


class Panel:
    """Draws sections one below the other in a column, for one step of an episode.

    `unit` is the scale of everything, 1 in a window of 1600 x 900. A `salient` one shows where the network
    looks.
    """

    def __init__(
        self,
        surface: pygame.Surface,
        room: pygame.Rect,
        unit: float,
        view: EpisodeView,
        step: int,
        salient: bool,
    ) -> None:
        self.surface, self.room, self.unit = surface, room, unit
        self.view, self.step, self.salient = view, step, salient
        self.numbers, self.world = view.telemetry, view.telemetry.world
        self.down = float(room.top)
        self.is_wide = room.width >= 380 * unit

    def size(self, pixels: float) -> int:
        """Return the size of letters."""
        return max(9, round(pixels * self.unit))

    def head(self, text: str, narrow: str = "") -> None:
        """Begin a section; `narrow` is the text of a narrow column where it differs."""
        text = text if self.is_wide or not narrow else narrow
        pen.write(self.surface, text, (self.room.left, self.down + 8 * self.unit), FAINT, self.size(13))
        self.down += 21 * self.unit

    def network_view(self) -> None:
        """Draw what the network sees, and where it looks."""
        unit, room = self.unit, self.room
        heat = self.view.salience(self.step) if self.salient else None
        pixels = f"{scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}"
        if not self.salient:
            self.head(f"what the network sees, {pixels} pixels", f"network's view, {pixels}")
        elif heat is None:
            self.head("no saliency without a network")
        else:
            self.head("orange: on what the highest Q depends most", "orange: what moves the highest Q")
        most = min(room.width, (420 if self.is_wide else 252) * unit)
        side = scene.SIZE * max(1, int(most // scene.SIZE))
        box = pygame.Rect(room.left, round(self.down), side, side)
        self.surface.blit(pen.from_array(self.view.see(self.step), side), box)
        if heat is not None:
            over = np.empty((*heat.shape, 4), dtype=np.uint8)
            over[..., :3], over[..., 3] = HEAT, (245 * heat).astype(np.uint8)
            glow = pygame.image.frombuffer(over.tobytes(), heat.shape, "RGBA")
            self.surface.blit(pygame.transform.smoothscale(glow, (side, side)), box)
        pygame.draw.rect(self.surface, RULE, box.inflate(2, 2), 1)
        self.down += side + 14 * unit

    def action(self) -> None:
        """Write the action taken now, or how the episode ended."""
        unit, chosen, outcome = self.unit, self.numbers.action(self.step), self.numbers.outcome
        at = (self.room.left, self.down + 35 * unit)
        if chosen is None:
            self.head("outcome" if outcome else "action")
            word, colour = (outcome or "your turn").upper(), OUTCOMES.get(outcome or "", TEXT)
            pen.write(self.surface, word, at, colour, self.size(28), True)
        else:
            self.head("action")
            speed, turn = self.world.actions[chosen]
            beside = pen.write(self.surface, f"a{chosen + 1}", at, CHOSEN, self.size(28), True) + 14 * unit
            side = "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"
            pen.write(self.surface, side, (beside, at[1] - 7 * unit), TEXT, self.size(15), True)
            words = f"{speed:g} m/s, {number(turn, 'g')} rad/s"
            pen.write(self.surface, words, (beside, at[1] + 11 * unit), FAINT, self.size(13))
        self.down += 46 * unit

    def values(self) -> None:
        """Write step, time, value, return and distances; all in one row where there is room for one only."""
        numbers, unit, step = self.numbers, self.unit, self.step
        is_row = self.room.height < 90 * unit
        columns = 6 if is_row else 3 if self.is_wide else 2
        q = numbers.q(step)
        # A pass at 45.1 m is no collision, one at 44.9 m is.
        closest = float(numbers.closest[step].min(initial=math.inf))
        entries = (
            ("step", f"{step} of {self.world.max_steps}"),
            ("time", f"{step * self.world.dt:g} s"),
            ("value V", "\N{EN DASH}" if q is None else number(float(q.mean()), ".3f")),
            ("return" if is_row else "return so far", number(float(numbers.total[step]), ".1f")),
            ("to the goal", f"{numbers.goal_distance[step]:.0f} m"),
            (
                "closest" if is_row else "closest so far",
                "no ships" if closest == math.inf else f"{closest:.1f} m",
            ),
        )
        for k, (what, value) in enumerate(entries):
            x = self.room.left + k % columns * self.room.width / columns
            y = self.down + k // columns * 46 * unit
            too_close = k == 5 and closest < self.world.safe_distance
            colour = OUTCOMES["collision"] if too_close else TEXT
            pen.write(self.surface, what, (x, y + 8 * unit), FAINT, self.size(12 if is_row else 13))
            pen.write(self.surface, value, (x, y + 27 * unit), colour, self.size(14 if is_row else 17), True)
        self.down += math.ceil(len(entries) / columns) * 46 * unit + 10 * unit

    def q_values(self) -> None:
        """Draw a bar for each action from the value to its Q, which is its advantage; mark the chosen one.

        Q changes far more in the course of an episode than between actions, so each step has its own scale.
        """
        unit, surface, room, size = self.unit, self.surface, self.room, self.size(13)
        q, chosen = self.numbers.q(self.step), self.numbers.action(self.step)
        count = len(self.world.actions)
        pitch = (26 if self.is_wide else 22) * unit
        left = room.left + (190 if self.is_wide else 46) * unit
        right = room.right - (150 if self.is_wide else 64) * unit
        end = room.right - (84 * unit if self.is_wide else 0)
        if self.numbers.q_values is None:
            self.head("actions (no Q-values)")
        else:
            self.head("Q of each action", "actions")
        zero, head = (left + right) / 2, self.down - 13 * unit
        if q is not None:
            pen.write(surface, "value V", (zero, head), SKY, size, across=0.5)
            pen.write(surface, "Q", (end, head), FAINT, size, across=1)
            if self.is_wide:
                word = "advantage" if pen.width_of("advantage", size) < 70 * unit else "adv."
                pen.write(surface, word, (room.right, head), FAINT, size, across=1)
        ahead = np.zeros(count) if q is None else q - q.mean()
        scale = (right - left) / 2 / max(1e-6, float(np.abs(ahead).max()))
        for k in range(count):
            middle, is_chosen = self.down + (k + 0.5) * pitch, k == chosen
            colour = CHOSEN if is_chosen else TEXT
            if is_chosen:
                ground = pygame.Rect(0, 0, room.width + 8, round(pitch))
                ground.midleft = (room.left - 4, round(middle))
                pygame.draw.rect(surface, blend(CHOSEN, BACKGROUND, 0.16), ground, border_radius=4)
            name = f"a{k + 1}" + (" \N{BLACK LEFT-POINTING POINTER}" if is_chosen else "")
            pen.write(surface, name, (room.left, middle), colour, size, is_chosen)
            if self.is_wide or q is None:
                at = (room.left + 48 * unit, middle)
                pen.write(surface, action_text(self.world, k), at, TEXT if is_chosen else FAINT, size)
            if q is None:
                continue
            self._bar(zero, zero + float(ahead[k]) * scale, middle, 0.6 * pitch, CHOSEN if is_chosen else BAR)
            pen.write(surface, number(float(q[k]), ".3f"), (end, middle), colour, size, is_chosen, across=1)
            if self.is_wide:
                text = ("+" if ahead[k] > 0 else "") + number(float(ahead[k]), ".3f")
                pen.write(surface, text, (room.right, middle), colour, size, is_chosen, across=1)
        if q is not None:
            pen.line(surface, SKY, (zero, self.down), (zero, self.down + count * pitch), 2)
        self.down += count * pitch + 18 * unit

    def _bar(self, start: float, end: float, middle: float, height: float, colour: Colour) -> None:
        """Draw a bar from one place to another, in either direction."""
        box = pygame.Rect(0, 0, max(1, round(abs(end - start))), round(height))
        box.midleft = (round(min(start, end)), round(middle))
        pygame.draw.rect(self.surface, colour, box)

    def terms(self) -> None:
        """Draw the return so far, term by term."""
        unit, room = self.unit, self.room
        self.head("return so far, by reward term")
        rows = [*self.numbers.terms.items(), ("total", self.numbers.total)]
        most = max(1.0, *(float(np.abs(values).max()) for _, values in rows))
        left, right = room.left + 104 * unit, room.right - 78 * unit
        zero, pitch, size = (left + right) / 2, 26 * unit, self.size(14)
        for name, values in rows:
            is_total, value = name == "total", float(values[self.step])
            middle = self.down + pitch / 2
            if is_total:
                pen.line(self.surface, RULE, (room.left, self.down), (room.right, self.down))
            pen.write(self.surface, name, (room.left, middle), TEXT, size, is_total)
            if value:
                colour = TEXT if is_total else SKY if value > 0 else ORANGE
                self._bar(zero, zero + value / most * (right - left) / 2, middle, 14 * unit, colour)
            at = (room.right, middle)
            pen.write(self.surface, number(value, ".1f"), at, TEXT, size, is_total, across=1)
            self.down += pitch
        pen.line(self.surface, FAINT, (zero, self.down - len(rows) * pitch), (zero, self.down))
        self.down += 18 * unit

    def ships(self) -> None:
        """Write how far each target ship is, and how near it will come if all keep course and speed."""
        numbers, step, unit, room = self.numbers, self.step, self.unit, self.room
        count = len(numbers.case.target_ships)
        if not count:
            self.head("no target ships")
            return
        self.head("target ships; DCPA and TCPA if all keep course and speed", "target ships")
        rows = [{name: name for name in ("ship", "distance", "closest", "DCPA", "TCPA")}]
        for k in range(count):
            time, mark = float(numbers.tcpa[step, k]), "! " if numbers.is_danger(step, k) else ""
            rows.append(
                {
                    "ship": f"{k + 1}",
                    "distance": f"{numbers.apart[step, k]:.0f} m",
                    "closest": f"{numbers.closest[step, k]:.1f} m",
                    "DCPA": f"{mark}{numbers.dcpa[step, k]:.0f} m",
                    "TCPA": f"{time:.0f} s" if time > 0 else "passed",
                }
            )
        columns = [name for name in rows[0] if self.is_wide or name != "closest"]
        # Eight ships in a small window are closer together.
        pitch = min((26 if self.is_wide else 22) * unit, (room.bottom - self.down) / len(rows))
        size = min(self.size(14 if self.is_wide else 13), max(9, round(pitch * 0.72)))
        first = (40 if self.is_wide else 30) * unit
        gap = (room.width - first) / (len(columns) - 1)
        for row, cells in enumerate(rows):
            is_danger = row > 0 and numbers.is_danger(step, row - 1)
            for k, name in enumerate(columns):
                at, colour = (room.left + first + gap * k, self.down + pitch / 2), TEXT if row else FAINT
                if row and name == "ship":
                    colour = scene.TARGET
                elif is_danger and name in ("DCPA", "TCPA"):
                    colour = YELLOW
                is_bold = colour in (scene.TARGET, YELLOW)
                pen.write(self.surface, cells[name], at, colour, size, is_bold, across=1)
            self.down += pitch
        self.down += 10 * unit
