"""Q-value reuse: all that acts, learns and is saved uses the sum, and the source in it never changes."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from tensordict import TensorDict
from torch import Generator, Tensor

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network as load_config
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.learn.rollout import greedy_policy
from ship_trl.policies.named import load_network
from ship_trl.sim.cases import load_case, load_world
from ship_trl.transfer.methods import make_method
from ship_trl.transfer.methods.base import Origin, TransferMethod, fixed_copy
from ship_trl.transfer.weights import load_weights, save_weights
from tests.learn.worlds import draw

SCALES = 0.5, 0.25


def network(seed: int, layers: str = "paper") -> DuelingNetwork:
    return make_network(load_config(layers), 7, Generator().manual_seed(seed))


def reused(layers: str = "paper", begins: bool = True) -> tuple[DuelingNetwork, TransferMethod]:
    """Return a network that reuses another, and the method; if it `begins`, its own Q-values are 0."""
    target, source = network(9001, layers), network(9002, layers)
    method = make_method(Arm.parse("QR"))
    fixed = fixed_copy(source, source.state_dict())
    method.attach(Origin(fixed, draw, Generator(), 1.0, 0.0, *SCALES))
    method.copy(target, source.state_dict())
    if not begins:
        for name in ("value", "advantage"):
            getattr(target, name).load_state_dict(getattr(network(9001, layers), name).state_dict())
    return target, method


def observations(layers: str) -> Tensor:
    generator = Generator().manual_seed(9003)
    if layers == "vector":
        return torch.rand(6, load_config(layers).inputs, generator=generator)
    return draw(torch.rand(6, 2, generator=generator) * 8 - 4)


@pytest.mark.parametrize("layers", ["paper", "vector"])
def test_q_is_the_sum_in_the_rewards_of_the_target(layers: str) -> None:
    target, _ = reused(layers)
    seen, factor = observations(layers), SCALES[1] / SCALES[0]
    source_q = factor * network(9002, layers)(seen)
    torch.testing.assert_close(target(seen), source_q, rtol=1e-5, atol=1e-6)
    target, _ = reused(layers, begins=False)
    wanted = network(9001, layers)(seen) + source_q
    torch.testing.assert_close(target(seen), wanted, rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(target.dense_q_values(seen), wanted, rtol=1e-5, atol=1e-6)
    step = greedy_policy(target, lambda state: state)(TensorDict({"state": seen}, [len(seen)]))
    assert torch.equal(step["action"], wanted.argmax(-1))


@pytest.mark.parametrize("layers", ["paper", "vector"])
def test_the_file_holds_both_networks_and_is_refused_as_a_source(layers: str) -> None:
    target, _ = reused(layers, begins=False)
    path, seen = Path("policy.safetensors"), observations(layers)
    save_weights(path, target, {})
    env = make_env(load_case("1", load_world()), load_world())
    assert torch.equal(load_network(path, env)(seen), target(seen))
    with pytest.raises(ConfigError, match=r"source_file: .* \(method=q_reuse\); allowed: networks of other"):
        load_weights(path, network(9001, layers))
