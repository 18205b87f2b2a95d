"""The mean return of random actions."""

import pytest
import torch
from torch import Generator

from ship_trl.policies.random_policy import random_return
from ship_trl.sim.cases import load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import load_suite

WORLD = load_world()


@pytest.mark.parametrize("name", ["1", "4"])
def test_it_is_the_mean_of_episodes_of_the_environment(name: str) -> None:
    case = load_suite(name, WORLD)
    env, generator = ShipEnv(case, WORLD, 400), Generator().manual_seed(5)
    current, total, running = env.reset(), torch.zeros(400), torch.ones(400, dtype=torch.bool)
    for _ in range(WORLD.max_steps):
        after = env.step(current.set("action", torch.randint(7, (400,), generator=generator)))["next"]
        total += after["reward"][:, 0] * running
        running &= ~after["done"][:, 0]
        current = after.exclude("reward")
    assert not running.any()
    error = float(total.std()) / 20
    assert abs(random_return(case, WORLD, 1) - float(total.mean())) < 3.5 * error


def test_it_depends_on_its_seed_alone() -> None:
    case = load_suite("2", WORLD)
    torch.manual_seed(0)
    first = random_return(case, WORLD, 3, episodes=500)
    torch.manual_seed(1)
    assert random_return(case, WORLD, 3, episodes=500) == first != random_return(case, WORLD, 4, episodes=500)
