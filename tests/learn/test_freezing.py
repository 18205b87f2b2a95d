"""Frozen layers: features in place of states, both backends, and layers that thaw."""

import copy

import pytest
import torch
from torch import Generator

from ship_trl.config.types import BackendName, Precision
from ship_trl.learn.double_dqn import FEATURES, DoubleDQN, build
from ship_trl.learn.network import DuelingNetwork
from tests.learn import networks
from tests.learn.test_double_dqn import (
    batch,
    made,
    made_on_states,
    make,
    observed,
    stored,
)
from tests.learn.worlds import Freezing, draw, fast_setup, schedule


@pytest.mark.parametrize("frozen", [3, 4])
@pytest.mark.parametrize("precision", [Precision.fp32, Precision.bf16])
def test_features_are_the_activations_of_the_frozen_layers(frozen: int, precision: Precision) -> None:
    learner = made(frozen=frozen, precision=precision)
    assert learner.encoders and learner.online_network.frozen == frozen
    state = torch.rand(9, 2) * 8 - 4
    kept = learner.encoders[FEATURES](state)
    assert kept.shape == (9, {3: 3136, 4: 200}[frozen]) and kept.itemsize == 2
    x = draw(state) / 255.0
    for layer in learner.online_network.layers[:frozen]:
        x = torch.relu(torch.nn.functional.conv2d(x, layer.weight, layer.bias, layer.stride))
    wanted = x.permute(0, 2, 3, 1).flatten(1)
    # Half a step of float16 and of bfloat16, and the error of sums in another order.
    within = {Precision.fp32: 2**-11, Precision.bf16: 2**-8}[precision]
    assert ((kept.float() - wanted).abs() <= within * wanted + 1e-5 * wanted.max()).all()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("frozen", [3, 4])
def test_q_values_and_gradients_on_features_equal_those_on_states(frozen: int, seed: int) -> None:
    kept, dense = made(seed, frozen), made_on_states(seed, frozen)
    assert (stored(kept), stored(dense)) == (FEATURES, "state")
    found = []
    for learner in (kept, dense):
        data = observed(learner, batch(32))
        q = learner.online_network(data[learner.observed]).detach()
        learner.learn_from(data)
        found.append((q, [p.grad for p in learner.online_network.parameters() if p.grad is not None]))
    (got_q, got), (wanted_q, wanted) = found
    # A feature is rounded by 2^-11 of itself at most; in bfloat16 it would be 2^-8, and Q-values fail.
    assert (got_q - wanted_q).norm() < 2**-11 * wanted_q.norm()
    # A gradient turns on errors that are smaller than Q-values, and on which side of zero a unit is.
    assert len(got) == len(wanted) == 2 * (4 - frozen) + 6
    for mine, other in zip(got, wanted, strict=True):
        assert (mine - other).norm() < 0.02 * other.norm()


@pytest.mark.parametrize(
    ("name", "frozen"), [("paper", 0), ("five", 0), ("five", 3), ("five", 4), ("five", 5), ("wide", 3)]
)
def test_any_network_learns_the_same_with_both_backends(name: str, frozen: int) -> None:
    found = []
    for backend in (BackendName.incremental, BackendName.dense):
        network, learn = networks.network(name), schedule(backend=backend)
        learner = make(network, learn, 0, frozen)
        keeps = backend is BackendName.incremental and frozen >= {"paper": 3, "five": 4, "wide": 2}[name]
        assert bool(learner.encoders) == keeps
        before = {name: p.clone() for name, p in network.named_parameters()}
        found.append([float(learner.learn_from(observed(learner, batch()))) for _ in range(3)])
        for key, parameter in network.named_parameters():
            assert torch.equal(parameter, before[key]) == key.startswith(network.layer_names[:frozen]), key
    # Features are rounded to half precision.
    assert found[0] == pytest.approx(found[1], rel=2e-3)


def thawing(seed: int = 3) -> DoubleDQN:
    network = DuelingNetwork(1, 7, Generator().manual_seed(seed))
    exploration, replay = (Generator().manual_seed(seed) for _ in range(2))
    return build(fast_setup(network, draw, 7, schedule(), exploration, replay, Freezing(2, until=0.5)))


def test_a_thawed_layer_learns_and_its_target_follows() -> None:
    learner, step = thawing(), batch()
    learner.act(step.clone(), 0)
    for _ in range(3):
        learner.learn_from(observed(learner, batch()))
    frozen, slow = (net.layers[0].weight.clone() for net in (learner.online_network, learner.network))
    deep = learner.network.layers[3].weight.clone()
    learner.act(step.clone(), 20)
    # Thawing moves nothing: the target keeps what it had learned.
    assert torch.equal(learner.network.layers[3].weight, deep) and torch.equal(frozen, slow)
    before = copy.deepcopy(learner.network)
    learner.learn_from(observed(learner, batch()))
    for online, target, was in zip(
        learner.online_network.parameters(), learner.network.parameters(), before.parameters(), strict=True
    ):
        torch.testing.assert_close(target, was.lerp(online, 0.05), rtol=1e-6, atol=1e-8)
    assert not torch.equal(learner.online_network.layers[0].weight, frozen)
    assert not torch.equal(learner.network.layers[0].weight, slow)


def test_a_checkpoint_after_a_thaw_goes_on_with_the_same_bits() -> None:
    learner, other = thawing(), thawing(4)
    for episode in (0, 20):
        learner.act(batch(), episode)
        learner.learn_from(observed(learner, batch()))
    state = {key: value.clone() for key, value in learner.state_dict().items()}
    other.load_state_dict(state)
    losses = [one.learn_from(observed(one, batch())) for one in (learner, other) for _ in range(1)]
    assert torch.equal(*losses)
    pairs = zip(learner.network.parameters(), other.network.parameters(), strict=True)
    assert all(torch.equal(mine, theirs) for mine, theirs in pairs)
