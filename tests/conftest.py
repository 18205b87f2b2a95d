"""Shared by all tests: an empty folder to work in, the paper's world, cases by hand, one torch thread."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import settings

from ship_trl.config.types import World
from ship_trl.sim.cases import Case, TargetShip, load_world

torch.set_num_threads(1)
# The same examples every time, and no deadline: a busy machine is no fault of the code.
settings.register_profile("steady", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("steady")


@pytest.fixture(autouse=True)
def denormal_numbers() -> Iterator[None]:
    """Count with denormal numbers again after a test: a run in this process lets them be zero."""
    yield
    torch.set_flush_denormal(False)


def paper_world() -> World:
    """The shared physics of conf/world/paper.yaml."""
    return load_world()


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder of the test's own: results and cases of the one it was started in must not count."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def world() -> World:
    return paper_world()


@pytest.fixture
def make_case() -> Callable[..., Case]:
    """Build a case from target ships given as (x, y, heading in degrees, speed)."""

    def make(*ships: tuple[float, float, float, float], **changes: Any) -> Case:
        values: dict[str, Any] = {
            "start": [0.0, 0.0],
            "heading": 90.0,
            "goal": [0.0, 600.0],
            "ideal_path": "any",
        }
        return Case(**(values | changes), target_ships=[TargetShip(*ship) for ship in ships], name="made")

    return make
