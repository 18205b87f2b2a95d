"""The mean return of random actions."""

import pytest
import torch
from torch import Generator

from ship_trl.config.types import Perturbation
from ship_trl.policies.random_policy import random_return
from ship_trl.sim.cases import load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import load_suite, suite_of

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


def test_of_a_suite_it_is_the_mean_of_its_cases() -> None:
    paper = load_suite("paper", WORLD)
    cases = [random_return(suite_of(case), WORLD, 1, episodes=2000) for case in paper.cases]
    assert abs(random_return(paper, WORLD, episodes=14_000) - sum(cases) / 7) < 10
    near, far = (suite_of(paper.cases[0], Perturbation(own_position=bound)) for bound in (1.0, 400.0))
    assert random_return(far, WORLD) < random_return(near, WORLD) - 10
