"""What stands beside the picture of an episode: numbers, the action, its Q-values, the network's view."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.geometry import closest_approach
from ship_trl.sim.transition import Transition
from ship_trl.view.lettering import BAR, CHOSEN, FAINT, INK, OUTCOMES, PAPER, RULE, fit, font, number

WIDTH, HEIGHT = 392, 420
VIEW = 2 * scene.SIZE
VIEW_NAME = f"network's view, {scene.SIZE} \N{MULTIPLICATION SIGN} {scene.SIZE}"
# Left edges of the two columns, and the top of the lower block.
LEFT, RIGHT, LOWER = 14, WIDTH - VIEW - 14, HEIGHT - VIEW - 12


@dataclass(frozen=True)
class Log:
    """Numbers of an episode after each step, lists of T + 1; distances in metres, returns raw."""

    total: list[float]
    goal: list[float]
    closest: list[float]

    @classmethod
    def of(cls, case: Case, world: World, episode: Episode) -> Log:
        """Read them off an episode; `closest` is the least distance so far, within steps too."""
        motion = Transition(case, world, torch.device("cpu"))
        away = motion.away(episode.states)
        closest = [math.inf] * len(episode.states)
        if case.target_ships:
            first = torch.linalg.vector_norm(away[:1], dim=-1)
            apart = torch.cat((first, closest_approach(away[:-1], away[1:]))).amin(-1)
            closest = apart.cummin(0).values.tolist()
        total = [0.0, *episode.rewards.double().cumsum(0).tolist()]
        return cls(total, motion.goal_distance(episode.states).tolist(), closest)


class Panel:
    """Draws the panel of an episode, one step after the other.

    Args:
        case: its name and ideal path head the panel.
        world: time step, step limit and actions.
        episode: what was sailed.
        title: one line above; the case's name alone where it is empty.
    """

    def __init__(self, case: Case, world: World, episode: Episode, title: str = "") -> None:
        self.world, self.episode = world, episode
        self.log = Log.of(case, world, episode)
        q = episode.q_values
        # One scale for the whole episode, and bars from zero: lengths stay comparable.
        self.low, self.high = 0.0, 1.0
        if q is not None and q.numel():
            self.low, self.high = min(0.0, float(q.min())), max(0.0, float(q.max()))
        self.blank = self._heading(case, title)

    def __call__(self, step: int, seen: NDArray[np.uint8]) -> Image.Image:
        """Draw the panel after `step` steps, with what the network sees (uint8 [C, 84, 84])."""
        picture = self.blank.copy()
        pen = ImageDraw.Draw(picture)
        self._numbers(pen, step)
        self._action(pen, step)
        self._q_values(pen, step)
        view = Image.fromarray(seen[0] if len(seen) == 1 else np.moveaxis(seen, 0, -1))
        picture.paste(view.convert("RGB").resize((VIEW, VIEW), Image.Resampling.NEAREST), (RIGHT, LOWER))
        return picture

    def _heading(self, case: Case, title: str) -> Image.Image:
        picture = Image.new("RGB", (WIDTH, HEIGHT), PAPER)
        pen = ImageDraw.Draw(picture)
        name = f"case {case.name}"
        width = WIDTH - 2 * LEFT
        text, letters = fit(title or name, width, 17, bold=True)
        pen.text((LEFT, 28), text, INK, letters, anchor="ls")
        below = f"ideal path: {case.ideal_path}"
        if title:
            below = f"{name}, {below}"
        text, letters = fit(below, width, 12)
        pen.text((LEFT, 48), text, FAINT, letters, anchor="ls")
        pen.line((LEFT, 60, WIDTH - LEFT, 60), RULE)
        pen.line((LEFT, 142, WIDTH - LEFT, 142), RULE)
        pen.text((LEFT, LOWER - 24), "Q of each action", FAINT, font(12))
        pen.text((RIGHT, LOWER - 24), VIEW_NAME, FAINT, font(12))
        pen.rectangle((RIGHT - 1, LOWER - 1, RIGHT + VIEW, LOWER + VIEW), outline=RULE)
        return picture

    def _numbers(self, pen: ImageDraw.ImageDraw, step: int) -> None:
        log, world = self.log, self.world
        closest = log.closest[step]
        too_close = closest < world.safe_distance
        entries = (
            ("step", f"{step} of {world.max_steps}", INK),
            ("time", f"{step * world.dt:g} s", INK),
            ("return so far", number(log.total[step], ".1f"), INK),
            ("distance to goal", f"{log.goal[step]:.0f} m", INK),
            (
                "closest so far",
                # A pass at 45.1 m is no collision, one at 44.9 m is.
                f"{closest:.1f} m" if math.isfinite(closest) else "no ships",
                OUTCOMES["collision"] if too_close else INK,
            ),
            ("safe distance", f"{world.safe_distance:g} m", INK),
        )
        for k, (what, value, colour) in enumerate(entries):
            x, y = LEFT + 128 * (k % 3), 68 + 36 * (k // 3)
            pen.text((x, y), what, FAINT, font(11))
            pen.text((x, y + 14), value, colour, font(15, True))

    def _action(self, pen: ImageDraw.ImageDraw, step: int) -> None:
        """Write the action chosen now, or how the episode ended."""
        if step == self.episode.length:
            outcome = self.episode.outcome
            pen.text((LEFT, 151), "outcome", FAINT, font(11))
            pen.text((LEFT, 166), outcome.upper(), OUTCOMES[outcome], font(26, True))
            return
        action = int(self.episode.actions[step])
        speed, turn = self.world.actions[action]
        side = "keep course" if turn == 0 else "to port" if turn > 0 else "to starboard"
        pen.text((LEFT, 151), "action", FAINT, font(11))
        pen.text((LEFT, 166), f"a{action + 1}", CHOSEN, font(26, True))
        pen.text((LEFT + 52, 165), side, INK, font(15, True))
        pen.text((LEFT + 52, 184), f"v = {speed:g} m/s, ω = {number(turn, 'g')} rad/s", FAINT, font(12))

    def _q_values(self, pen: ImageDraw.ImageDraw, step: int) -> None:
        """Draw a bar for each action; none after the last step, nor for a policy without Q-values."""
        count = len(self.world.actions)
        pitch = VIEW / count
        left, right = LEFT + 28, RIGHT - 66
        scale = (right - left) / ((self.high - self.low) or 1.0)
        zero = left - self.low * scale
        q, sailing = self.episode.q_values, step < self.episode.length
        values = q[step].tolist() if sailing and q is not None else []
        for k in range(count):
            chosen = sailing and k == int(self.episode.actions[step])
            middle = LOWER + (k + 0.5) * pitch
            colour = CHOSEN if chosen else FAINT
            pen.text((LEFT, middle), f"a{k + 1}", colour, font(12, chosen), anchor="lm")
            if not values:
                continue
            reach = zero + values[k] * scale
            bar = (min(zero, reach), middle - 0.3 * pitch, max(zero, reach), middle + 0.3 * pitch)
            pen.rectangle(tuple(round(v) for v in bar), CHOSEN if chosen else BAR)
            text = number(values[k], ".3f")
            pen.text((RIGHT - 14, middle), text, CHOSEN if chosen else INK, font(12, chosen), anchor="rm")
        pen.line((round(zero), LOWER, round(zero), LOWER + VIEW), FAINT)
