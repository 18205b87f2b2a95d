"""Returns of many draws at once equal those of the same networks, one after another."""

import copy

import pytest
import torch
from torch import Generator

from ship_trl.learn.jumpstart import jumpstart
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from tests.learn.networks import NETWORKS, ODD
from tests.learn.worlds import Corridor, draw

DRAWS = 7


# The networks `paper` and `five` use the incremental backend, `odd` the dense one.
@pytest.mark.parametrize(
    ("name", "copied"), [*(("paper", n) for n in range(5)), ("five", 3), ("five", 5), ("odd", 1), ("odd", 3)]
)
@pytest.mark.parametrize("at_once", [1, 3, 10])
def test_jumpstart_returns_equal_single_rollouts(name: str, copied: int, at_once: int) -> None:
    layers = (NETWORKS | ODD)[name]
    network, alone = (DuelingNetwork(1, 3, Generator().manual_seed(1), layers) for _ in range(2))
    names = alone.layer_names[:copied]
    before = copy.deepcopy(network.state_dict())
    found = jumpstart(Corridor(at_once), draw, network, names, DRAWS, Generator().manual_seed(2))
    generator, wanted = Generator().manual_seed(2), []
    for _ in range(DRAWS):
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
