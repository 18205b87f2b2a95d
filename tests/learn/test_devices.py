"""Code for the GPU names its device everywhere; no GPU is needed.

The default device is `meta`, whose tensors hold no data. A tensor made without a device is on `meta`, and
fails when it meets the others, which are on the CPU by name.
"""

from collections.abc import Iterator

import pytest
import torch
from torch import Generator

from ship_trl.config.types import Precision
from ship_trl.fast.worlds import make_env, make_rasteriser
from ship_trl.learn import double_dqn
from ship_trl.learn.algorithm import Setup
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.train import Finished, train
from ship_trl.sim.cases import load_case, load_world
from tests.learn.worlds import Freezing, schedule

CPU = torch.device("cpu")
WORLD = load_world()


@pytest.fixture
def meta_device() -> Iterator[None]:
    """Make `meta` the default device."""
    torch.set_default_device("meta")
    try:
        yield
    finally:
        torch.set_default_device(None)


def test_the_guard_notices_a_tensor_without_a_device(meta_device: None) -> None:
    with pytest.raises(RuntimeError):
        _ = torch.zeros(3, device=CPU) + torch.zeros(3)


def test_the_learner_names_its_device(meta_device: None) -> None:
    case, learn = load_case("4", WORLD), schedule(episodes=4, precision=Precision.fp32)
    env = make_env(case, WORLD, learn.num_envs, device=CPU, fast=False)
    eval_env = make_env(case, WORLD, 1, device=CPU, fast=False)
    draw = make_rasteriser(WORLD, device=CPU, fast=False)
    generators = [Generator(device="cpu").manual_seed(k) for k in range(3)]
    with torch.device("cpu"):  # weights are made there and moved
        network = DuelingNetwork(1, 7, generators[0])
    algorithm = double_dqn.build(Setup(network, draw, 7, learn, generators[1], generators[2], Freezing(3)))
    before = network.shared.weight.clone()
    events = list(train(env, eval_env, algorithm, learn))
    assert len([e for e in events if isinstance(e, Finished)]) == 4
    assert not torch.equal(network.shared.weight, before)
    assert {p.device for p in algorithm.network.parameters()} == {CPU}
