"""A person at the helm: what each key does, when the ship sails on, and where the episode is kept."""

from __future__ import annotations

from pathlib import Path

import pygame

from ship_trl.config.types import World
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.sim.cases import Case
from ship_trl.sim.reference import best_known
from ship_trl.sim.render import Rasteriser
from ship_trl.view.lettering import number
from ship_trl.viewer.helm import Helm
from ship_trl.viewer.panel import action_words
from ship_trl.viewer.player import Player
from ship_trl.viewer.screen import Screen
from ship_trl.viewer.show import Show, make_show
from ship_trl.viewer.window import Press

KEYS = (
    ("\N{LEFTWARDS ARROW} \N{RIGHTWARDS ARROW}", "rudder to port, to starboard, one action at a time"),
    ("\N{UPWARDS ARROW}", "keep course, full speed"),
    ("1 to 7", "the actions a1 to a7 of table 1"),
    ("Space", "sail, pause; after the end, once more"),
    ("+ \N{MINUS SIGN}", "faster, slower"),
    ("R", "begin again; what was sailed is lost"),
    ("C", "next case"),
    ("A", "absolute frame (north up), or relative (own ship in the middle)"),
    ("T", "true size of hulls, or as the network sees them"),
    ("H", "these keys"),
    ("Q, Esc", "quit"),
)
BY = "keyboard"


class Game(Screen):
    """Sails episodes by keys; finished ones are kept as demonstrations.

    Args:
        cases: the first is sailed first.
        world: its physics.
        folder: where demonstrations are kept; None, they are not.
        speed: seconds of the world in one of ours.
    """

    def __init__(self, cases: list[Case], world: World, folder: Path | None, speed: float) -> None:
        super().__init__(KEYS)
        self.cases, self.world, self.folder = cases, world, folder
        self.kept: list[Path] = []
        self.place, self.episode, self.message = 0, 1, ""
        self.speed = speed
        self.begin(0)
        self.keys |= {
            "left": lambda: self.helm.turn(-1),
            "right": lambda: self.helm.turn(1),
            "up": lambda: self.helm.midships(),
            "space": self.pause,
            "+": lambda: self.player.faster(),
            "=": lambda: self.player.faster(),
            "-": lambda: self.player.faster(-1),
            "r": lambda: self.begin(0),
            "c": lambda: self.begin(1),
        }

    def begin(self, cases: int) -> None:
        """Lay the ship at the start, of the case so many places on; it waits there."""
        self.place = (self.place + cases) % len(self.cases)
        case = self.cases[self.place]
        self.helm = Helm(case, self.world)
        self.rasteriser = Rasteriser(case, self.world)
        self.best = best_known(case, self.world).episode_return
        self.player = Player(0, self.world.dt, running=False, speed=self.speed)
        self.message = "Space: sail"
        self.shows = self._shows()

    def pause(self) -> None:
        """Sail on, stop, or begin again after the end."""
        if self.helm.over and self.player.at_end:
            self.episode += 1
            self.begin(0)
        self.message = ""
        self.player.running = not self.player.running

    def tick(self, seconds: float) -> bool:
        """Let time pass; the ship takes its next action whenever it has sailed the last one."""
        if not self.player.running:
            return False
        if self.player.at_end and not self.helm.over:
            self.player.steps = self.helm.step().steps
            self.shows = self._shows()
        self.player.advance(seconds)
        if self.player.at_end:
            if self.helm.over:
                self.finish()
            else:
                # The episode goes on with the next action.
                self.player.running = True
        return True

    def finish(self) -> None:
        """Say how the episode ended, and keep it."""
        sailed = self.helm.telemetry
        total = float(sailed.total[-1])
        self.message = f"{sailed.outcome}: {number(total, '.1f')} of {number(self.best, '.1f')}"
        if self.folder is not None:
            ended = total, str(sailed.outcome)
            actions = self.helm.actions
            try:
                self.kept.append(
                    write_demonstration(self.folder, self.helm.case, self.helm.world, actions, ended, BY)
                )
                self.message += f", kept as {self.kept[-1].name}"
            except OSError as error:
                self.message += f", not kept: {error.strerror}"
        self.message += "; Space: once more"

    def press(self, press: Press, surface: pygame.Surface) -> None:
        """Do what a key stands for."""
        super().press(press, surface)
        if press.key.isdigit():
            self.helm.put(int(press.key) - 1)

    @property
    def status(self) -> str:
        """Give the line at the top: a message, or the rudder and the best known return."""
        rudder = self.helm.rudder
        words = f"rudder a{rudder + 1}, {action_words(self.helm.world, rudder)}"
        if self.helm.over:
            return self.message
        return f"{words}    {self.message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def _shows(self) -> list[Show]:
        return [make_show("you", self.helm.telemetry, self.rasteriser, episode=str(self.episode))]
