"""The base class of interactive windows: the loop, the drawing, and the keys that all of them have."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace

import pygame

from ship_trl.view.dashboard import Look, draw_dashboard, step_at
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.window.player import Player

FRAMES_PER_SECOND = 60
LEFT, RIGHT = "\N{LEFTWARDS ARROW}", "\N{RIGHTWARDS ARROW}"
UP, DOWN = "\N{UPWARDS ARROW}", "\N{DOWNWARDS ARROW}"
# A line of the help: how keys are called, what they do, and their actions by pygame's names of keys.
Binding = tuple[str, str, Mapping[str, Callable[[], object]]]


class Interactive(ABC):
    """Shows episodes at the position of a player, and does what keys and clicks stand for.

    A subclass sets `player` and `views`, and puts its own keys before the common ones in `bindings`.
    """

    player: Player
    views: list[EpisodeView]

    def __init__(self) -> None:
        self.look, self.has_help, self.is_closed = Look(), False, False
        self.bindings: list[Binding] = [
            ("A", "absolute frame (north up), or own ship in the middle", {"a": self.look_key("absolute")}),
            ("T", "true size of hulls, or as the network sees them", {"t": self.look_key("to_scale")}),
            ("H", "these keys", {"h": self._toggle_help, "f1": self._toggle_help}),
            ("Q, Esc", "quit", {"q": self._close, "escape": self._escape}),
        ]

    @property
    @abstractmethod
    def status(self) -> str:
        """The line at the top."""

    @abstractmethod
    def tick(self, seconds: float) -> bool:
        """Let time pass; return whether the picture has changed."""

    def click(self, at: tuple[int, int]) -> None:
        """Go to a step that was clicked in a graph."""
        step = step_at(pygame.display.get_window_size(), self.views, at)
        if step is not None:
            self.player.seek(step)

    def press(self, key: str) -> None:
        """Do what a key stands for, by pygame's name for it ("space", "left", "a")."""
        for _, _, actions in self.bindings:
            if key in actions:
                actions[key]()

    def show(self) -> pygame.Surface:
        """Draw what is to be seen now in the open window; return its surface."""
        surface = pygame.display.get_surface()
        assert surface is not None
        keys = [binding[:2] for binding in self.bindings] if self.has_help else []
        draw_dashboard(surface, self.views, self.player.position, self.look, self.status, keys)
        pygame.display.flip()
        return surface

    def handle_events(self) -> bool:
        """Do what was pressed since the last call; return whether to draw again."""
        events = pygame.event.get()
        for event in events:
            if event.type == pygame.QUIT:
                self._close()
            elif event.type == pygame.KEYDOWN:
                self.press(pygame.key.name(event.key))
            elif (event.type == pygame.MOUSEBUTTONDOWN and event.button == 1) or (
                event.type == pygame.MOUSEMOTION and event.buttons[0]
            ):
                self.click(event.pos)
        return any(event.type != pygame.MOUSEMOTION or event.buttons[0] for event in events)

    def run(self) -> None:
        """Go on in the open window until it is closed; draw only after a change."""
        clock, has_changed = pygame.time.Clock(), True
        while not self.is_closed:
            if has_changed:
                self.show()
            has_changed = self.tick(clock.tick(FRAMES_PER_SECOND) / 1000)
            has_changed = self.handle_events() or has_changed

    def look_key(self, name: str) -> Callable[[], None]:
        """Make the action of a key that turns a look on and off."""

        def toggle() -> None:
            self.look = replace(self.look, **{name: not getattr(self.look, name)})

        return toggle

    def _toggle_help(self) -> None:
        self.has_help = not self.has_help

    def _escape(self) -> None:
        """Leave the help, or the window."""
        self.has_help, self.is_closed = False, not self.has_help

    def _close(self) -> None:
        self.is_closed = True
