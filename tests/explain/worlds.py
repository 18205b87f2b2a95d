"""States of a case, and untrained networks to run episodes with."""

from functools import cache

import torch
from torch import Generator

from ship_trl.explain.states import StateSet, draw_states
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.env import ShipEnv


def a_network(seed: int = 0) -> DuelingNetwork:
    return DuelingNetwork(1, 7, Generator().manual_seed(seed))


@cache
def env_of(name: str = "4") -> ShipEnv:
    world = load_world()
    return make_env(load_case(name, world), world)


@cache
def some_states(name: str = "4", episodes: int = 60, seed: int = 0) -> StateSet:
    torch.set_num_threads(1)
    return draw_states(env_of(name), a_network(), episodes, Generator().manual_seed(seed))
