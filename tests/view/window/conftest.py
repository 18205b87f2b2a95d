"""An SDL window that shows nothing, for every test in this folder."""

from collections.abc import Iterator

import pygame
import pytest

from ship_trl.view.window.window import open_window


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(pygame.display, "get_desktop_sizes", lambda: [(1920, 1080)])
    with open_window((1120, 630)):
        yield
