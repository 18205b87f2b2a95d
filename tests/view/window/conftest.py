"""An SDL window that shows nothing, for every test in this folder."""

from collections.abc import Iterator

import pytest

from ship_trl.view.window.window import open_window


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with open_window((1120, 630)):
        yield
