"""The window in which episodes are played: open it, run its loop, handle the keys that all windows share."""

from __future__ import annotations

import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import pygame

from ship_trl.config.errors import ConfigError
from ship_trl.view.dashboard import Look, draw_dashboard, step_at
from ship_trl.view.episode_view import EpisodeView

DRIVER = "SDL_VIDEODRIVER"
FRAMES_PER_SECOND = 60
# Share of the screen's sides that a window takes at most: its title and a task bar need room.
SHARE = 0.9
# Simulated seconds per real second.
SPEEDS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
# A line of the help: the keys, what they do, and the actions by pygame's names of the keys.
Binding = tuple[str, str, Mapping[str, Callable[[], object]]]


@contextmanager
def open_window(size: tuple[int, int], advice: str = "") -> Iterator[None]:
    """Open a resizable window that fits the screen, and close it; without a screen give `advice`.

    Raises:
        ConfigError: there is no screen.
    """
    requested = os.environ.get(DRIVER)
    if not requested and sys.platform.startswith("linux"):
        drivers = {"WAYLAND_DISPLAY": "wayland", "DISPLAY": "x11"}
        available = [driver for name, driver in drivers.items() if os.environ.get(name)]
        if not available:
            raise ConfigError(f"no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); {advice}")
        # Without a list SDL tries other drivers too, some of which show nothing.
        os.environ[DRIVER] = ",".join(available)
    # By default SDL copies each frame into a texture. Where OpenGL runs on the CPU, that takes four times
    # as long as drawing the frame.
    os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
    try:
        pygame.display.init()
        desktop = pygame.display.get_desktop_sizes()[0]
        width, height = (min(side, int(SHARE * most)) for side, most in zip(size, desktop, strict=True))
        pygame.display.set_mode((width, height), pygame.RESIZABLE)
        pygame.display.set_caption("ship_trl")
        pygame.key.set_repeat(350, 60)
        yield
    except pygame.error as error:
        raise ConfigError(f"no screen ({error}); {advice}") from None
    finally:
        pygame.display.quit()
        if not requested:
            os.environ.pop(DRIVER, None)


class Window(ABC):
    """Plays episodes in the open window, and handles keys and clicks.

    `position` is in steps, and a whole number while paused. A subclass sets `views`, and puts its own keys
    before the shared ones in `bindings`.
    """

    views: list[EpisodeView]

    def __init__(self, speed: float) -> None:
        self.position, self.is_running, self.speed = 0.0, True, speed
        self.look, self.has_help, self.is_closed = Look(), False, False
        relative, large = partial(self.toggle_look, "relative"), partial(self.toggle_look, "large")
        self.bindings: list[Binding] = [
            ("A", "own ship in the middle (relative frame), or north up (absolute)", {"a": relative}),
            ("T", "hulls as large as the network sees them, or to scale", {"t": large}),
            ("H", "these keys", {"h": self._toggle_help, "f1": self._toggle_help}),
            ("Q, Esc", "quit", {"q": self._close, "escape": self._escape}),
        ]

    @property
    @abstractmethod
    def status(self) -> str:
        """The text at the top right."""

    @abstractmethod
    def tick(self, seconds: float) -> bool:
        """Let real time pass; return whether the picture has changed."""

    @property
    def steps(self) -> int:
        """Number of steps of the longest episode shown."""
        return max(view.telemetry.steps for view in self.views)

    @property
    def is_at_end(self) -> bool:
        """Whether nothing is left to play."""
        return self.position >= self.steps

    def advance(self, seconds: float) -> None:
        """Play for some real seconds, and pause at the end."""
        if self.is_running:
            steps = seconds * self.speed / self.views[0].telemetry.world.dt
            self.position = min(self.position + steps, float(self.steps))
            self.is_running = not self.is_at_end

    def pause(self) -> None:
        """Pause at the current step, or continue; at the end, restart."""
        if self.is_running:
            self.seek(int(self.position))
        elif self.is_at_end:
            self.restart()
        else:
            self.is_running = True

    def step(self, count: int) -> None:
        """Pause, and move by `count` whole steps."""
        is_back_from_between = count < 0 and self.position > int(self.position)
        self.seek(int(self.position) + count + is_back_from_between)

    def seek(self, step: int) -> None:
        """Pause at a step, or at the nearest one that exists."""
        self.is_running = False
        self.position = float(min(max(step, 0), self.steps))

    def restart(self) -> None:
        """Play from the start."""
        self.position, self.is_running = 0.0, True

    def change_speed(self, levels: int) -> None:
        """Move by `levels` in `SPEEDS`, as far as they go."""
        level = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed)) + levels
        self.speed = SPEEDS[min(max(level, 0), len(SPEEDS) - 1)]

    def toggle_look(self, name: str) -> None:
        """Turn one field of the look on or off."""
        self.look = replace(self.look, **{name: not getattr(self.look, name)})

    def show(self) -> pygame.Surface:
        """Draw the current picture in the open window; return its surface."""
        surface = pygame.display.get_surface()
        assert surface is not None
        keys = [binding[:2] for binding in self.bindings] if self.has_help else []
        draw_dashboard(surface, self.views, self.position, self.look, self.status, keys)
        pygame.display.flip()
        return surface

    def handle_events(self) -> bool:
        """Handle the events since the last call; return whether to draw again."""
        events = pygame.event.get()
        for event in events:
            if event.type == pygame.QUIT:
                self._close()
            elif event.type == pygame.KEYDOWN:
                self.press(pygame.key.name(event.key))
            elif (event.type == pygame.MOUSEBUTTONDOWN and event.button == 1) or (
                event.type == pygame.MOUSEMOTION and event.buttons[0]
            ):
                step = step_at(pygame.display.get_window_size(), self.views, event.pos)
                if step is not None:
                    self.seek(step)
        return any(event.type != pygame.MOUSEMOTION or event.buttons[0] for event in events)

    def run(self) -> None:
        """Run until the window is closed; draw only after a change."""
        clock, has_changed = pygame.time.Clock(), True
        while not self.is_closed:
            if has_changed:
                self.show()
            has_changed = self.tick(clock.tick(FRAMES_PER_SECOND) / 1000)
            has_changed = self.handle_events() or has_changed

    def press(self, key: str) -> None:
        """Do what a key stands for, by pygame's name for it ("space", "left", "a")."""
        for _, _, actions in self.bindings:
            if key in actions:
                actions[key]()

    def _toggle_help(self) -> None:
        self.has_help = not self.has_help

    def _escape(self) -> None:
        """Leave the help, or close the window."""
        self.has_help, self.is_closed = False, not self.has_help

    def _close(self) -> None:
        self.is_closed = True
