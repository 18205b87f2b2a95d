"""Opening a window, or saying why there is none."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pygame

# Drivers of SDL that show nothing; SDL takes them without being asked where there is no screen.
INVISIBLE = ("dummy", "offscreen", "evdev")
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
DRIVER = "SDL_VIDEODRIVER"


class NoScreenError(Exception):
    """There is no screen for a window."""


@contextmanager
def open_window(size: tuple[int, int], title: str) -> Iterator[None]:
    """Open a window of variable size, and close it in the end.

    Raises:
        NoScreenError: there is no screen, and `SDL_VIDEODRIVER` asks for no driver.
    """
    asked = os.environ.get(DRIVER)
    screens = [name for name in SCREENS if os.environ.get(name)]
    if not asked and sys.platform.startswith("linux"):
        if not screens:
            raise NoScreenError("neither DISPLAY nor WAYLAND_DISPLAY is set")
        if screens == ["DISPLAY"]:
            # SDL would try Wayland first, and print a complaint.
            os.environ[DRIVER] = "x11"
    # By default SDL copies each frame into a texture, which takes four times as long as drawing it where
    # OpenGL computes on the CPU.
    os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
    try:
        pygame.display.init()
        driver = pygame.display.get_driver()
        if driver in INVISIBLE and asked != driver:
            raise NoScreenError(f"SDL finds none, and offers {driver}")
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.display.set_caption(title)
        pygame.key.set_repeat(350, 60)
        yield
    except pygame.error as error:
        raise NoScreenError(str(error)) from None
    finally:
        pygame.display.quit()
        if not asked:
            os.environ.pop(DRIVER, None)
