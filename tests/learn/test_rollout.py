"""Policies of Q-networks, episodes of any policy, and returns of many draws at once."""

import copy

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator

from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import EpsilonGreedy, greedy_policy, jumpstart, rollout
from tests.learn.networks import NETWORKS, ODD
from tests.learn.worlds import Corridor, draw


def test_greedy_takes_the_action_of_the_highest_q_value() -> None:
    network = DuelingNetwork(1, 3, Generator().manual_seed(0))
    state = torch.rand(6, 2) * 8 - 4
    found = greedy_policy(network, draw)(TensorDict({"state": state}, [6]))
    assert torch.equal(found["action_value"], network(draw(state)))
    assert torch.equal(found["action"], found["action_value"].argmax(-1))
    assert torch.equal(found["chosen_action_value"], found["action_value"].amax(-1, keepdim=True))


def test_q_values_are_computed_for_greedy_rows_only() -> None:
    asked: list[int] = []

    def best(observation: torch.Tensor) -> torch.Tensor:
        asked.append(len(observation))
        return torch.full((len(observation),), 9)

    policy = EpsilonGreedy(best, "state", 3, Generator().manual_seed(0))
    for epsilon in (0.0, 0.5, 1.0):
        policy.epsilon = epsilon
        action = policy(TensorDict({"state": torch.zeros(50, 2)}, [50]))["action"]
        assert int((action == 9).sum()) == (asked.pop() if asked else 0)
        assert set(action.tolist()) <= {0, 1, 2, 9}


def test_a_rollout_of_many_is_a_rollout_of_each() -> None:
    # Each row keeps its own direction, so that episodes end at different times.
    def holding(courses: list[int]) -> object:
        def policy(step: TensorDictBase) -> TensorDictBase:
            # Back and forth until the third second, then one course.
            late = step["state"][:, 1] > torch.arange(len(courses))
            return step.set("action", torch.where(late, torch.tensor(courses), 1 - torch.tensor(courses)))

        return policy

    courses = [1, 0, 1, 1]
    together = rollout(Corridor(4), holding(courses))  # type: ignore[arg-type]
    assert len({episode.length for episode in together}) > 1
    for k, episode in enumerate(together):
        alone = rollout(Corridor(4), holding(courses))[k]  # type: ignore[arg-type]
        assert torch.equal(alone.states, episode.states) and torch.equal(alone.actions, episode.actions)
        assert len(episode.states) == episode.length + 1 == len(episode.rewards) + 1
        place = float(episode.states[-1, 0])
        assert episode.outcome == {4.0: "goal", -4.0: "collision"}.get(place, "timeout")
        gain = {"goal": 100, "collision": -100, "timeout": 0}[episode.outcome]
        assert episode.episode_return == gain - episode.length
        assert episode.q_values is None


# The networks `paper` and `five` use the incremental backend, `odd` the dense one.
@pytest.mark.parametrize(("name", "copied"), [*(("paper", n) for n in (0, 3, 4)), ("five", 5), ("odd", 1)])
@pytest.mark.parametrize("at_once", [3, 10])
def test_jumpstart_returns_equal_single_rollouts(name: str, copied: int, at_once: int) -> None:
    layers = (NETWORKS | ODD)[name]
    network, alone = (DuelingNetwork(1, 3, Generator().manual_seed(1), layers) for _ in range(2))
    names = alone.layer_names[:copied]
    before = copy.deepcopy(network.state_dict())
    found = jumpstart(Corridor(at_once), draw, network, names, 7, Generator().manual_seed(2))
    generator, wanted = Generator().manual_seed(2), []
    for _ in range(7):
        alone.reset(generator, names)
        shared = {key: value for key, value in alone.state_dict().items() if key.startswith(names)}
        assert all(torch.equal(value, before[key]) for key, value in shared.items())
        wanted.append(rollout(Corridor(1), greedy_policy(alone, draw))[0].episode_return)
    assert found == wanted
    assert len(set(found)) > 1
    assert all(torch.equal(value, before[key]) for key, value in network.state_dict().items())


def test_zero_draws_give_no_returns() -> None:
    network = DuelingNetwork(1, 3, Generator().manual_seed(1))
    assert jumpstart(Corridor(2), draw, network, (), 0, Generator()) == []
