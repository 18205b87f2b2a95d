"""A window: opens, shows a surface, gives keys by their names. What they mean is for others to say."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import pygame

FRAMES_PER_SECOND = 60
# Drivers of SDL that show nothing; it takes them by itself where there is no screen.
BLIND = ("dummy", "offscreen", "evdev")
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
DRIVER = "SDL_VIDEODRIVER"


class NoScreenError(Exception):
    """There is nothing on which a window could be opened."""


@dataclass(frozen=True)
class Press:
    """A key by pygame's name for it ("space", "left", "a"), or a place that was clicked on or dragged to."""

    key: str = ""
    at: tuple[int, int] | None = None


class Window:
    """An open window of any size; `surface` is what it shows after `present`."""

    def __init__(self) -> None:
        self._clock = pygame.time.Clock()
        self.closed = False
        # Whether the window must be drawn anew: it is another size, or something lay over it.
        self.stale = True

    @property
    def surface(self) -> pygame.Surface:
        """The surface, which is another one after the window has been given another size."""
        surface = pygame.display.get_surface()
        assert surface is not None
        return surface

    def presses(self) -> list[Press]:
        """Give what was pressed since the last call; closing the window sets `closed`."""
        found = []
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                self.closed = True
            elif event.type in (pygame.WINDOWEXPOSED, pygame.WINDOWSIZECHANGED):
                self.stale = True
            elif event.type == pygame.KEYDOWN:
                found.append(Press(pygame.key.name(event.key)))
            elif (event.type == pygame.MOUSEBUTTONDOWN and event.button == 1) or (
                event.type == pygame.MOUSEMOTION and event.buttons[0]
            ):
                found.append(Press(at=event.pos))
        return found

    def held(self, key: str) -> bool:
        """Tell whether a key is down now."""
        return bool(pygame.key.get_pressed()[pygame.key.key_code(key)])

    def present(self, parts: Sequence[pygame.Rect] = ()) -> None:
        """Show what has been drawn on the surface, or only parts of it where the rest is shown already."""
        if parts and not self.stale:
            pygame.display.update(list(parts))
        else:
            pygame.display.flip()
        self.stale = False

    def wait(self) -> float:
        """Wait for the next frame; returns the seconds since the last one."""
        return self._clock.tick(FRAMES_PER_SECOND) / 1000


@contextmanager
def open_window(size: tuple[int, int], title: str) -> Iterator[Window]:
    """Open a window that can be made larger and smaller, and close it in the end.

    Raises:
        NoScreenError: there is no screen, and no driver was asked for by `SDL_VIDEODRIVER`.
    """
    asked = os.environ.get(DRIVER)
    given = [name for name in SCREENS if os.environ.get(name)]
    if not asked and sys.platform.startswith("linux"):
        if not given:
            raise NoScreenError("neither DISPLAY nor WAYLAND_DISPLAY is set")
        if given == ["DISPLAY"]:
            # SDL would try Wayland first, and print_error in words of its own.
            os.environ[DRIVER] = "x11"
    # SDL would copy each frame into a texture, which takes four times as long as drawing it where OpenGL
    # computes on the CPU; pixels that are drawn here go to the screen as they are.
    os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
    try:
        pygame.display.init()
        driver = pygame.display.get_driver()
        if driver in BLIND and asked != driver:
            raise NoScreenError(f"SDL finds none, and offers {driver}")
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.display.set_caption(title)
        pygame.key.set_repeat(350, 60)
        yield Window()
    except pygame.error as error:
        raise NoScreenError(str(error)) from None
    finally:
        pygame.display.quit()
        if not asked:
            os.environ.pop(DRIVER, None)
