"""Each method of transfer learns: a tiny network in a corridor of nine places, in a second or two each."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from tensordict import TensorDict, TensorDictBase
from torch import Generator, Tensor
from torchrl.data import Unbounded

from ship_trl.config.arm import Arm
from ship_trl.config.types import Network
from ship_trl.learn.algorithm import LearningHooks
from ship_trl.learn.double_dqn import build
from ship_trl.learn.network import DuelingNetwork, VectorNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.learn.train import Evaluated, train
from ship_trl.transfer.methods import guide, make_method
from ship_trl.transfer.methods.base import Origin, fixed_copy
from ship_trl.transfer.weights import Weights
from tests.learn.worlds import Corridor, fast_setup, schedule

SEED = 9001
# Four steps to the goal.
BEST = 96.0


def draw(state: Tensor) -> Tensor:
    return state / 4


class Hall(Corridor):
    """The corridor, seen as numbers."""

    right = 1

    def __init__(self, num_envs: int) -> None:
        super().__init__(num_envs)
        self.observation_spec["vector"] = Unbounded(shape=(num_envs, 2))

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDict:
        found = super()._reset(tensordict)
        return found.set("vector", draw(found["state"]))

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        goes_right = (tensordict["action"] == self.right).long()
        found = super()._step(tensordict.exclude("action").set("action", goes_right))
        return found.set("vector", draw(found["state"]))


class Turned(Hall):
    """One where another action goes right, so that the source collides."""

    right = 2


def make_network(seed: int) -> VectorNetwork:
    config = Network(linear=[32, 32], ships=1)
    return VectorNetwork(2, 3, Generator().manual_seed(seed), config)


def learn(world: type[Hall], network: VectorNetwork, method: LearningHooks) -> list[float]:
    """Train the network, and return the greedy returns before and after."""
    short = schedule(episodes=120, evaluate_every=120, update_every=2, batch_size=32, gamma=0.8)
    learn = replace(short, lr=5e-3, lr_end=5e-3, tau=0.3, epsilon_end=0.3)
    exploration, replay = (Generator().manual_seed(SEED + k) for k in (1, 2))
    algorithm = build(fast_setup(network, draw, 3, learn, exploration, replay, method))
    events = train(world(learn.num_envs), world(1), algorithm, learn)
    return [event.episode_return for event in events if isinstance(event, Evaluated)]


@cache
def source_weights() -> Weights:
    """Return the weights of a network that has learned the corridor."""
    network = make_network(SEED)
    assert learn(Hall, network, LearningHooks())[-1] == BEST
    return {key: value.detach() for key, value in network.state_dict().items()}


def greedy_return(world: type[Hall], network: DuelingNetwork) -> float:
    return rollout(world(1), greedy_policy(network, draw))[0].episode_return


@pytest.mark.long
@pytest.mark.parametrize(
    ("arm", "world"),
    [
        ("FTH", Turned),
        ("GU1", Turned),
        ("SP1", Turned),
        ("QR", Turned),
        # These follow their source.
        ("G", Hall),
        ("QD", Hall),
    ],
)
def test_a_method_learns(arm: str, world: type[Hall], monkeypatch: pytest.MonkeyPatch) -> None:
    # The corridor counts an episode's steps in another place of its states.
    monkeypatch.setattr(guide, "STEP", 1)
    network, method, weights = make_network(SEED + 6), make_method(Arm.parse(arm)), source_weights()
    source = fixed_copy(network, weights)
    high, low = (greedy_return(world, one) for one in (source, network))
    method.attach(Origin(source, draw, Generator().manual_seed(SEED + 4), high, low))
    method.copy(network, weights)
    before, after = learn(world, network, method)
    assert before < after == BEST
