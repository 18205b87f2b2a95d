"""Steer a ship in a window; finished episodes are kept as demonstrations."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import torch

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.reference import best_known
from ship_trl.sim.cases import Case
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.telemetry import Telemetry, measure
from ship_trl.view.window.window import Window
from ship_trl.view.words import action_text, number

AUTHOR = "keyboard"
SPEED = 2.0


class Game(Window):
    """Lets a person steer; finished episodes are kept in `folder`, unless it is None.

    `actions` are those of the episode so far; `rudder` is the index of the next one.
    """

    def __init__(self, cases: list[Case], world: World, folder: Path | None, speed: float = SPEED) -> None:
        super().__init__(speed)
        self.cases, self.world, self.folder = cases, world, folder
        self.kept: list[Path] = []
        turns = [turn for _, turn in world.actions]
        self._port_to_starboard = sorted(range(len(turns)), key=lambda k: -turns[k])
        self._place = 0
        self.begin(0)
        digits = {str(k + 1): partial(self.steer, k) for k in range(len(turns))}
        port, starboard = partial(self.turn, -1), partial(self.turn, 1)
        straight = partial(self.steer, world.straight_action)
        faster, slower = partial(self.change_speed, 1), partial(self.change_speed, -1)
        self.bindings[:0] = [
            ("← →", "the next action to port, to starboard", {"left": port, "right": starboard}),
            ("↑", "keep course, full speed", {"up": straight}),
            ("1 to 7", "the actions a1 to a7 of table 1", digits),
            ("Space", "start, pause; at the end, play again", {"space": self.pause}),
            ("+ \N{MINUS SIGN}", "faster, slower", {"+": faster, "=": faster, "-": slower}),
            ("R", "restart; the episode is not kept", {"r": partial(self.begin, 0)}),
            ("C", "next case", {"c": partial(self.begin, 1)}),
        ]

    @property
    def telemetry(self) -> Telemetry:
        """The episode so far."""
        return self.views[0].telemetry

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return self.telemetry.outcome is not None

    @property
    def status(self) -> str:
        """How the episode ended, or the rudder and the best known return."""
        if self.is_over:
            return self._message
        words = f"rudder a{self.rudder + 1}, {action_text(self.world, self.rudder)}"
        return f"{words}    {self._message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def begin(self, forward: int) -> None:
        """Wait at the start of the case that is `forward` places further in the list."""
        self._place = (self._place + forward) % len(self.cases)
        self.case = self.cases[self._place]
        self.actions, self.rudder = list[int](), self.world.straight_action
        self.best = best_known(self.case, self.world).episode_return
        self._motion = Transition(self.world)
        self._states = [initial_state(self.case, self.world)[None]]
        self._rasteriser = make_rasteriser(self.world)
        self.position, self.is_running, self._message = 0.0, False, "Space: start"
        self._measure()

    def steer(self, action: int) -> None:
        """Choose the next action."""
        self.rudder = action

    def turn(self, count: int) -> None:
        """Move the rudder by `count` actions to starboard, as far as they go."""
        place = self._port_to_starboard.index(self.rudder) + count
        self.rudder = self._port_to_starboard[min(max(place, 0), len(self._port_to_starboard) - 1)]

    def pause(self) -> None:
        """Pause or continue; after the end of the episode, begin again."""
        if self.is_over and self.is_at_end:
            self.begin(0)
        self._message = ""
        self.is_running = not self.is_running

    def tick(self, seconds: float) -> bool:
        """Play on; the ship takes its next action when the last one is played."""
        if not self.is_running:
            return False
        if self.is_at_end and not self.is_over:
            self._states.append(self._motion(self._states[-1], torch.tensor([self.rudder])).state)
            self.actions.append(self.rudder)
            self._measure()
        self.advance(seconds)
        if self.is_at_end and self.is_over:
            self.finish()
        else:
            # It pauses after each action, but the episode continues.
            self.is_running = True
        return True

    def finish(self) -> None:
        """Show how the episode ended, and keep it."""
        total, outcome = float(self.telemetry.total[-1]), str(self.telemetry.outcome)
        self._message = f"{outcome}: {number(total, '.1f')} of {number(self.best, '.1f')}"
        if self.folder is not None:
            ended = total, outcome
            try:
                path = write_demonstration(self.folder, self.case, self.world, self.actions, ended, AUTHOR)
                self.kept.append(path)
                self._message += f", kept as {path.name}"
            except OSError as error:
                self._message += f", not kept: {error.strerror}"
        self._message += "; Space: play again"

    def _measure(self) -> None:
        actions = torch.tensor(self.actions, dtype=torch.int64)
        telemetry = measure(self.case, self.world, torch.cat(self._states), actions)
        self.views = [EpisodeView("you", telemetry, self._rasteriser)]
