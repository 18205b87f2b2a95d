"""Open a window, or say why that is impossible."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pygame

from ship_trl.config.errors import ConfigError

# Drivers of SDL that show nothing; SDL takes them without being asked where there is no screen.
INVISIBLE = ("dummy", "offscreen", "evdev")
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
DRIVER = "SDL_VIDEODRIVER"


@contextmanager
def open_window(size: tuple[int, int], without: str = "") -> Iterator[None]:
    """Open a window of variable size, and close it in the end; `without` says what to do without a screen.

    Raises:
        ConfigError: there is no screen, and `SDL_VIDEODRIVER` asks for no driver.
    """
    asked = os.environ.get(DRIVER)
    screens = [name for name in SCREENS if os.environ.get(name)]
    if not asked and sys.platform.startswith("linux"):
        if not screens:
            raise ConfigError(f"no screen (neither DISPLAY nor WAYLAND_DISPLAY is set); {without}")
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
            raise ConfigError(f"no screen (SDL finds none, and offers {driver}); {without}")
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.display.set_caption("ship_trl")
        pygame.key.set_repeat(350, 60)
        yield
    except pygame.error as error:
        raise ConfigError(f"no screen ({error}); {without}") from None
    finally:
        pygame.display.quit()
        if not asked:
            os.environ.pop(DRIVER, None)
