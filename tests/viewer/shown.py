"""What the tests of the viewer show: policies that are sailed in no time, an untrained network."""

from collections.abc import Sequence

import numpy as np
import pygame
from numpy.typing import NDArray
from torch import Generator

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.entry import Entry
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.view.draw import to_array
from ship_trl.viewer.dashboard import Dashboard, Look
from ship_trl.viewer.show import Show, make_show
from ship_trl.viewer.telemetry import of_episode
from tests.view.sailing import sail


def entry(policy: str = "keep_course", case: str = "4") -> Entry:
    """A policy on a shipped case."""
    world = load_world()
    return Entry(policy, policy, load_case(case, world), world, colour=False)


def show(case: Case, world: World, actions: Sequence[int], network: bool = False) -> Show:
    """An episode with made-up Q-values."""
    numbers = of_episode(case, world, sail(case, world, actions))
    rasteriser = Rasteriser(case, world)
    made = DuelingNetwork(1, len(world.actions), Generator().manual_seed(0)) if network else None
    return make_show("made up", numbers, rasteriser, made)


def drawn(
    shows: Sequence[Show], position: float, look: Look | None = None, size: tuple[int, int] = (1600, 900)
) -> NDArray[np.uint8]:
    """The pixels of a dashboard."""
    surface = pygame.Surface(size, depth=32)
    Dashboard().draw(surface, shows, position, look or Look())
    return to_array(surface)
