"""Steering a ship in a window: its keys, when the next step is taken, and where the episode is kept."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import torch

from ship_trl.config.types import World
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.named import straight_action
from ship_trl.sim.cases import Case
from ship_trl.sim.reference import best_known
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.transition import Transition
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.telemetry import Telemetry, measure
from ship_trl.view.window.interactive import LEFT, RIGHT, UP, Interactive
from ship_trl.view.window.player import Player
from ship_trl.view.words import action_text, number

AUTHOR = "keyboard"
# Seconds of the world in one of ours.
SPEED = 2.0


class Helm:
    """An episode that is being steered, on a straight course until the rudder is moved.

    `rudder` is the index of the action that the next step takes. `telemetry` is the episode so far.
    """

    def __init__(self, case: Case, world: World) -> None:
        self.case, self.world, self.actions = case, world, list[int]()
        self._motion = Transition(case, world, torch.device("cpu"))
        self._states = [self._motion.start[None]]
        turns = [turn for _, turn in world.actions]
        self._port_to_starboard = sorted(range(len(turns)), key=lambda k: -turns[k])
        self.rudder = straight_action(world)
        self.telemetry = self._measure()

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return self.telemetry.outcome is not None

    def turn(self, count: int) -> None:
        """Move the rudder `count` actions to starboard (to port if negative), as far as there are any."""
        place = self._port_to_starboard.index(self.rudder) + count
        self.rudder = self._port_to_starboard[min(max(place, 0), len(self._port_to_starboard) - 1)]

    def step(self) -> None:
        """Take one step, unless the episode has ended."""
        if not self.is_over:
            self._states.append(self._motion(self._states[-1], torch.tensor([self.rudder])).state)
            self.actions.append(self.rudder)
            self.telemetry = self._measure()

    def _measure(self) -> Telemetry:
        actions = torch.tensor(self.actions, dtype=torch.int64)
        return measure(self.case, self.world, torch.cat(self._states), actions)


class Game(Interactive):
    """Lets a person steer; finished episodes are kept in `folder` as demonstrations, unless it is None.

    `speed` is seconds of the world in one of ours.
    """

    def __init__(self, cases: list[Case], world: World, folder: Path | None, speed: float = SPEED) -> None:
        super().__init__()
        self.cases, self.world, self.folder = cases, world, folder
        self.kept: list[Path] = []
        self.place, self.speed, self.message = 0, speed, ""
        self.begin(0)
        digits = {str(k + 1): partial(self.steer, k) for k in range(len(world.actions))}
        faster, slower = (lambda: self.player.change_speed(1)), (lambda: self.player.change_speed(-1))
        port, starboard = (lambda: self.helm.turn(-1)), (lambda: self.helm.turn(1))
        self.bindings[:0] = [
            (f"{LEFT} {RIGHT}", "an action to port, to starboard", {"left": port, "right": starboard}),
            (UP, "keep course, full speed", {"up": partial(self.steer, straight_action(world))}),
            ("1 to 7", "the actions a1 to a7 of table 1", digits),
            ("Space", "start, pause; after the end, once more", {"space": self.pause}),
            ("+ \N{MINUS SIGN}", "faster, slower", {"+": faster, "=": faster, "-": slower}),
            ("R", "begin again; the episode is not kept", {"r": lambda: self.begin(0)}),
            ("C", "next case", {"c": lambda: self.begin(1)}),
        ]

    def begin(self, forward: int) -> None:
        """Put the ship at the start of the case that is `forward` places on; it waits there."""
        self.place = (self.place + forward) % len(self.cases)
        case = self.cases[self.place]
        self.helm = Helm(case, self.world)
        self.rasteriser = Rasteriser(case, self.world)
        self.best = best_known(case, self.world).episode_return
        self.player = Player(0, self.world.dt, running=False, speed=self.speed)
        self.message = "Space: start"
        self._show()

    def steer(self, action: int) -> None:
        """Put the rudder at an action."""
        self.helm.rudder = action

    def pause(self) -> None:
        """Go on, stop, or begin again after the end."""
        if self.helm.is_over and self.player.at_end:
            self.begin(0)
        self.message = ""
        self.player.running = not self.player.running

    def tick(self, seconds: float) -> bool:
        """Let time pass; the ship takes its next action whenever the last one is played."""
        if not self.player.running:
            return False
        if self.player.at_end and not self.helm.is_over:
            self.helm.step()
            self.player.steps = self.helm.telemetry.steps
            self._show()
        self.player.advance(seconds)
        if self.player.at_end:
            if self.helm.is_over:
                self.finish()
            else:
                # The player stops at its end; the episode goes on with the next action.
                self.player.running = True
        return True

    def finish(self) -> None:
        """Show how the episode ended, and keep it."""
        telemetry = self.helm.telemetry
        total, outcome = float(telemetry.total[-1]), str(telemetry.outcome)
        self.message = f"{outcome}: {number(total, '.1f')} of {number(self.best, '.1f')}"
        if self.folder is not None:
            case, actions = self.helm.case, self.helm.actions
            try:
                path = write_demonstration(self.folder, case, self.world, actions, (total, outcome), AUTHOR)
                self.kept.append(path)
                self.message += f", kept as {path.name}"
            except OSError as error:
                self.message += f", not kept: {error.strerror}"
        self.message += "; Space: once more"

    @property
    def status(self) -> str:
        """The line at the top: a message, or the rudder and the best known return."""
        if self.helm.is_over:
            return self.message
        rudder = self.helm.rudder
        words = f"rudder a{rudder + 1}, {action_text(self.world, rudder)}"
        return f"{words}    {self.message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def _show(self) -> None:
        self.views = [EpisodeView("you", self.helm.telemetry, self.rasteriser)]
