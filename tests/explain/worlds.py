"""States of a case, sailed by a network that has learned nothing."""

from functools import cache

import torch
from torch import Generator

from ship_trl.explain.saliency import choose
from ship_trl.explain.states import StateSet, draw_states
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.render import Rasteriser


def a_network(seed: int = 0) -> DuelingNetwork:
    return DuelingNetwork(1, 7, Generator().manual_seed(seed))


@cache
def case_of(name: str = "4") -> Case:
    return load_case(name, load_world())


@cache
def some_states(name: str = "4", episodes: int = 60, seed: int = 0) -> StateSet:
    case, world = case_of(name), load_world()
    draw, network = Rasteriser(case, world), a_network()
    torch.set_num_threads(1)
    generator = Generator().manual_seed(seed)
    return draw_states(case, world, draw, lambda pixels: choose(network, pixels), episodes, generator)
