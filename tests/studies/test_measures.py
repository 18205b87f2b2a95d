"""Measures that need networks, on toy networks and bundled cases."""

import dataclasses

import pytest
import torch
from torch import Generator

from ship_trl.config.network import load_network as load_layers
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.policies.named import load_network
from ship_trl.policies.pretrained import networks
from ship_trl.sim.cases import load_case, load_world
from studies.sources.measures import MEASURES, Known

WORLD = load_world()
ACTIONS = len(WORLD.actions)


def small(seed: int) -> DuelingNetwork:
    config = dataclasses.replace(load_layers("vector"), linear=[16, 16], per_ship=1)
    return make_network(config, ACTIONS, Generator().manual_seed(seed))


@pytest.fixture(scope="module")
def network() -> DuelingNetwork:
    return small(9001)


@pytest.fixture(scope="module")
def target(network: DuelingNetwork) -> Known:
    return known("4", network)


def known(name: str, network: DuelingNetwork) -> Known:
    return Known(load_case(name, WORLD), WORLD, network)


def measure(name: str, source: Known, target: Known) -> float:
    return MEASURES[name].value(source, target)


def test_a_case_is_most_similar_to_itself(network: DuelingNetwork, target: Known) -> None:
    same, other = known("4", network), known("4", small(9002))
    expected = {"gradient": 1, "cka": 1, "q_distance": 0, "policy_agreement": 1, "ships": 0, "similarity": 1}
    assert {name: measure(name, same, target) for name in expected} == pytest.approx(expected, abs=1e-5)
    assert measure("cka", other, target) < 1 and measure("policy_agreement", other, target) < 1
    assert (
        measure("q_distance", other, target) > 0
        and -1 <= measure("gradient", other, known("2", small(9002))) <= 1
    )


def test_an_action_that_the_planner_takes_agrees_as_often_as_it_takes_it(target: Known) -> None:
    always = small(9001)
    with torch.no_grad():
        always.advantage.weight.zero_()
        always.advantage.bias.copy_(torch.arange(ACTIONS) == WORLD.straight_action)
    share = (target.probe["planned"] == WORLD.straight_action).float().mean()
    assert 0 < share < 1
    assert measure("agreement", known("1", always), target) == pytest.approx(float(share))


def test_a_straight_course_reaches_the_goal_of_case_1_at_once(target: Known) -> None:
    always = small(9001)
    with torch.no_grad():
        always.advantage.weight.zero_()
        always.advantage.bias.copy_(torch.arange(ACTIONS) == WORLD.straight_action)
    source = known("4", always)
    assert measure("zero_shot", source, known("1", always)) == pytest.approx(1, abs=1e-3)
    # In case 4 a straight course ends in a collision.
    assert measure("zero_shot", source, target) < 0.1
    assert measure("visits", known("1", always), known("1", always)) == pytest.approx(1)
    assert measure("visits", known("1", always), target) < 1


def test_features_that_hold_the_planners_actions_have_a_higher_logme(target: Known) -> None:
    (path,) = (one.file for one in networks() if one.name == "4")
    learned = known("4", load_network(path, target.env, "source_file"))
    blind = small(9001)
    with torch.no_grad():
        blind.shared.weight.zero_()
    assert measure("logme", learned, target) > measure("logme", known("4", blind), target)
