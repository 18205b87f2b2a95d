"""A person at the helm: what each key does, when the ship sails on, and where the episode is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pygame

from ship_trl.demonstrations import write_demonstration
from ship_trl.sim.cases import Case
from ship_trl.sim.reference import best_known
from ship_trl.sim.render import Rasteriser
from ship_trl.view.lettering import number
from ship_trl.viewer.dashboard import Dashboard, Look
from ship_trl.viewer.helm import Helm
from ship_trl.viewer.panel import action_words
from ship_trl.viewer.player import Player
from ship_trl.viewer.show import Show, make_show
from ship_trl.viewer.window import Press, Window

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


class Game:
    """Sails episodes by keys; finished ones are kept as demonstrations.

    Args:
        cases: the first is sailed first.
        helm: makes the helm of a case.
        folder: where demonstrations are kept; None, they are not.
        speed: seconds of the world in one of ours.
    """

    def __init__(
        self, cases: list[Case], helm: Callable[[Case], Helm], folder: Path | None, speed: float
    ) -> None:
        self.cases, self.make_helm, self.folder = cases, helm, folder
        self.look, self.help, self.closed = Look(), False, False
        self.dashboard = Dashboard()
        self.kept: list[Path] = []
        self.place, self.episode, self.message = 0, 1, ""
        self.speed = speed
        self.begin(0)
        self.keys: dict[str, Callable[[], None]] = {
            "left": lambda: self.helm.turn(-1),
            "right": lambda: self.helm.turn(1),
            "up": lambda: self.helm.midships(),
            "space": self.pause,
            "+": lambda: self.player.faster(),
            "=": lambda: self.player.faster(),
            "-": lambda: self.player.faster(-1),
            "r": lambda: self.begin(0),
            "c": lambda: self.begin(1),
            "a": lambda: self._look(absolute=not self.look.absolute),
            "t": lambda: self._look(to_scale=not self.look.to_scale),
            "h": self._toggle_help,
            "f1": self._toggle_help,
            "q": self._close,
            "escape": self._escape,
        }

    def begin(self, cases: int) -> None:
        """Lay the ship at the start, of the case so many places on; it waits there."""
        self.place = (self.place + cases) % len(self.cases)
        self.helm = self.make_helm(self.cases[self.place])
        case, world = self.helm.case, self.helm.world
        self.rasteriser = Rasteriser(case, world)
        self.best = best_known(case, world).episode_return
        self.player = Player(0, world.dt, running=False, speed=self.speed)
        self.message = "Space: sail"
        self.show = self._show()

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
            self.show = self._show()
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

    def press(self, press: Press) -> None:
        """Do what a key stands for."""
        if press.key in self.keys:
            self.keys[press.key]()
        elif press.key.isdigit():
            self.helm.put(int(press.key) - 1)

    @property
    def status(self) -> str:
        """Give the line at the top: a message, or the rudder and the best known return."""
        rudder = self.helm.rudder
        words = f"rudder a{rudder + 1}, {action_words(self.helm.world, rudder)}"
        if self.helm.over:
            return self.message
        return f"{words}    {self.message or 'best known ' + number(self.best, '.1f')}    H: keys"

    def draw(self, surface: pygame.Surface) -> None:
        """Draw what is to be seen now."""
        keys = KEYS if self.help else ()
        self.dashboard.draw(surface, [self.show], self.player.position, self.look, self.status, keys)

    def run(self, window: Window) -> None:
        """Sail until the window is closed."""
        while not (self.closed or window.closed):
            changed = self.tick(window.wait())
            for press in window.presses():
                self.press(press)
                changed = True
            if changed or window.stale:
                self.draw(window.surface)
                window.present()

    def _show(self) -> Show:
        return make_show("you", self.helm.telemetry, self.rasteriser, episode=str(self.episode))

    def _look(self, **change: bool) -> None:
        self.look = Look(**{**vars(self.look), **change})

    def _toggle_help(self) -> None:
        self.help = not self.help

    def _escape(self) -> None:
        """Leave the list of keys, or the window."""
        if self.help:
            self.help = False
        else:
            self._close()

    def _close(self) -> None:
        self.closed = True
