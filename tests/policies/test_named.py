"""A policy acts on the scenes of the environment in which it acts, whatever it was made for."""

import pytest
import torch

import ship_trl as package
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.policies.named import load_policy, network_of
from ship_trl.sim.cases import load_case
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.suites import load_suite


def test_a_network_of_case_4_sees_the_ships_of_case_6(world: World) -> None:
    policy = package.load_policy("4")
    network = network_of(policy)
    assert network is not None
    env, own = (ShipEnv(load_case(name, world), world, 3, from_pixels=True) for name in ("6", "4"))
    current, own_current = env.reset(), own.reset()
    for _ in range(10):
        wanted = network(current["pixels"])
        others = network(own_current["pixels"])
        current = policy(current)
        assert torch.equal(current["action_value"], wanted) and torch.equal(
            current["action"], wanted.argmax(-1)
        )
        assert not bool((wanted == others).any())
        own_current = own.step(own_current.set("action", current["action"]))["next"]
        current = env.step(current)["next"]


def test_in_a_mixed_suite_each_row_is_seen_as_its_own_case(world: World) -> None:
    suite = load_suite("paper", world)
    env = ShipEnv(suite, world, 20)
    policy = load_policy("pretrained:4", env)
    acted = policy(env.reset())
    alone = {}
    for case in suite.cases:
        single = ShipEnv(case, world)
        alone[case.name] = load_policy("pretrained:4", single)(single.reset())["action_value"][0]
    rows = acted["action_value"]
    seen = {name for row in rows for name, q in alone.items() if torch.allclose(row, q, atol=1e-4)}
    assert all(any(torch.allclose(row, q, atol=1e-4) for q in alone.values()) for row in rows)
    assert len(seen) > 4 and not torch.allclose(alone["4"], alone["6"], atol=1e-2)


@pytest.mark.parametrize("name", ["pretrained", "best_known"])
def test_a_policy_of_one_case_is_refused_in_a_suite_of_several(name: str, world: World) -> None:
    with pytest.raises(ConfigError, match="suite paper: has several cases; allowed: one case"):
        load_policy(name, ShipEnv(load_suite("paper", world), world))
