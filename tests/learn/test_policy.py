"""Policies of a Q-network, and episodes of any policy."""

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Generator

from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import EpsilonGreedy, greedy_policy
from ship_trl.learn.rollout import rollout
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
