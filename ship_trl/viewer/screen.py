"""Somebody before a window: the loop, the drawing, and the keys that every window of ours has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace

import pygame

from ship_trl.viewer.dashboard import Dashboard, Look
from ship_trl.viewer.player import Player
from ship_trl.viewer.show import Show
from ship_trl.viewer.window import Press, Window


class Screen(ABC):
    """What is shown, and what keys do; a subclass adds its own to `keys`, by pygame's names.

    Args:
        help_lines: keys and what they do, for people.
    """

    player: Player
    shows: list[Show]

    def __init__(self, help_lines: Sequence[tuple[str, str]]) -> None:
        self.help_lines = help_lines
        self.look, self.help, self.closed = Look(), False, False
        self.dashboard = Dashboard()
        self.keys: dict[str, Callable[[], None]] = {
            "a": lambda: self._look(absolute=not self.look.absolute),
            "t": lambda: self._look(to_scale=not self.look.to_scale),
            "h": self._toggle_help,
            "f1": self._toggle_help,
            "q": self._close,
            "escape": self._escape,
        }

    @property
    @abstractmethod
    def status(self) -> str:
        """Give the line at the top."""

    @abstractmethod
    def tick(self, seconds: float) -> bool:
        """Let time pass; returns whether the picture has changed."""

    def press(self, press: Press, surface: pygame.Surface) -> None:
        """Do what a key or a click stands for; `surface` is what is shown."""
        if press.key in self.keys:
            self.keys[press.key]()

    def pressed(self, press: Press, window: Window) -> None:
        """Do what a press in a window stands for."""
        self.press(press, window.surface)

    def draw(self, surface: pygame.Surface) -> list[pygame.Rect]:
        """Draw what is to be seen now; returns the parts that have changed."""
        keys = self.help_lines if self.help else ()
        return self.dashboard.draw(surface, self.shows, self.player.position, self.look, self.status, keys)

    def run(self, window: Window) -> None:
        """Go on until the window is closed, drawing only what has changed."""
        while not (self.closed or window.closed):
            changed = self.tick(window.wait())
            for press in window.presses():
                changed = True
                self.pressed(press, window)
            if changed or window.stale:
                window.present(self.draw(window.surface))

    def _look(self, **change: bool) -> None:
        self.look = replace(self.look, **change)

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
