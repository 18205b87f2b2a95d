"""The double-DQN update, exploration, freezing, and the soft target."""

import copy
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Generator, Tensor

from ship_trl.config.types import BackendName, Learn, Loss, Network, Precision
from ship_trl.learn.algorithm import Method, Setup
from ship_trl.learn.double_dqn import DoubleDQN, build
from ship_trl.learn.fast.features import FEATURES
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.replay import DrawPixels
from tests.learn import networks
from tests.learn.worlds import draw, schedule


class Freezing(Method):
    """Freezes the first layers, and adds nothing to the loss."""

    def __init__(self, layers: int) -> None:
        self.layers = layers

    def frozen_layers(self, progress: float) -> int:
        return self.layers


def make(
    network: DuelingNetwork, learn: Learn, seed: int = 0, frozen: int = 0, draw: Any = draw
) -> DoubleDQN:
    exploration, replay = (Generator().manual_seed(seed) for _ in range(2))
    return build(Setup(network, draw, 7, learn, exploration, replay, Freezing(frozen)))


def made(seed: int = 0, frozen: int = 0, **changes: object) -> DoubleDQN:
    network = DuelingNetwork(1, 7, Generator().manual_seed(seed))
    return make(network, schedule(**changes), seed, frozen)


def stored(learner: DoubleDQN) -> str:
    """Return the key that the replay stores and the policy reads."""
    return FEATURES if learner.encoders else "state"


def batch(size: int = 6) -> TensorDict:
    generator = Generator().manual_seed(5)
    state = torch.rand(size, 2, generator=generator) * 8 - 4
    after = torch.rand(size, 2, generator=generator) * 8 - 4
    terminated = torch.tensor([[True], [False]] * (size // 2))
    return TensorDict(
        {
            "state": state,
            "action": torch.randint(7, (size,), generator=generator),
            "next": {
                "state": after,
                "reward": torch.rand(size, 1, generator=generator),
                "done": torch.ones(size, 1, dtype=torch.bool),
                "terminated": terminated,
            },
        },
        batch_size=[size],
    )


def act(learner: DoubleDQN, observation: Tensor, epsilon: float) -> Tensor:
    learner.policy.epsilon = epsilon
    given = TensorDict({stored(learner): observation}, [len(observation)])
    action: Tensor = learner.policy(given)["action"]
    return action


def observed(learner: DoubleDQN, data: TensorDict) -> TensorDict:
    """Return a batch as the replay does: with pixels, or with features of the frozen layers."""
    if not learner.encoders:
        pixels: TensorDict = DrawPixels(draw)(data)
        return pixels
    features = data.exclude("state", ("next", "state"))
    features["features"] = learner.encoders[FEATURES](data["state"])
    features["next", "features"] = learner.encoders[FEATURES](data["next", "state"])
    return features


def made_on_states(seed: int, frozen: int) -> DoubleDQN:
    """Return an algorithm whose replay stores states although layers are frozen."""
    network = DuelingNetwork(1, 7, Generator().manual_seed(seed))
    network.linear_from = 5
    return make(network, schedule(), seed, frozen)


def by_hand(online: DuelingNetwork, target: DuelingNetwork, data: TensorDict, learn: Learn) -> Tensor:
    """Equation 2 with the double-DQN target, in plain torch; a truncated step bootstraps."""
    with torch.no_grad():
        choice = online(draw(data["next", "state"])).argmax(-1, keepdim=True)
        future = target(draw(data["next", "state"])).gather(-1, choice)
        wanted = data["next", "reward"] + learn.gamma * future * ~data["next", "terminated"]
    got = online(draw(data["state"])).gather(-1, data["action"][:, None])
    if learn.loss is Loss["l2"]:
        return (got - wanted).square().mean()
    return torch.nn.functional.smooth_l1_loss(got, wanted, beta=learn.huber_delta) * learn.huber_delta


def test_loss_is_double_dqn_with_bootstrapped_truncation() -> None:
    for loss in ("l2", "huber"):
        learner = made(loss=Loss[loss])
        target = copy.deepcopy(learner.online_network)
        for _ in range(3):  # after the first update online and target differ
            wanted = by_hand(learner.online_network, target, batch(), schedule(loss=Loss[loss]))
            got = learner.learn_from(observed(learner, batch()))
            torch.testing.assert_close(got, wanted.detach(), rtol=1e-5, atol=1e-7)
            with torch.no_grad():
                for slow, fast in zip(target.parameters(), learner.online_network.parameters(), strict=True):
                    slow.lerp_(fast, 0.05)


def test_updates_reach_the_network_that_acts() -> None:
    learner = made()
    before = [p.clone() for p in learner.online_network.parameters()]
    learner.learn_from(observed(learner, batch()))
    assert all(
        not torch.equal(a, b) for a, b in zip(before, learner.online_network.parameters(), strict=True)
    )


def test_frozen_layers_keep_their_bytes_and_stay_out_of_the_optimiser() -> None:
    learner = made(frozen=2)
    before = {name: p.clone() for name, p in learner.online_network.named_parameters()}
    for _ in range(5):
        learner.learn_from(observed(learner, batch()))
    for name, parameter in learner.online_network.named_parameters():
        assert torch.equal(parameter, before[name]) == name.startswith(("conv1", "conv2"))
    trained = {p.data_ptr() for group in learner.optimiser.param_groups for p in group["params"]}
    places = {name: p.data_ptr() for name, p in learner.online_network.named_parameters()}
    assert {name for name, place in places.items() if place not in trained} == {
        f"{layer}.{kind}" for layer in ("conv1", "conv2") for kind in ("weight", "bias")
    }
    slow = learner.network.state_dict()
    for name in ("conv1.weight", "conv2.bias"):
        assert torch.equal(slow[name], before[name])


@pytest.mark.parametrize("frozen", [-1, 5])
def test_no_more_layers_are_frozen_than_there_are(frozen: int) -> None:
    with pytest.raises(ValueError, match="layers to freeze: allowed: 0 to 4, got"):
        made(frozen=frozen)


@pytest.mark.parametrize("frozen", [0, 2, 3, 4])
def test_actions_use_the_latest_weights(frozen: int) -> None:
    # A grey background and biases: its activations are not zero, and change with the weights.
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if name.endswith("bias"):
                parameter.uniform_(-0.3, 0.3, generator=Generator().manual_seed(1))
    grey = lambda state: draw(state) // 2 + 100  # noqa: E731
    grey.background = draw.background // 2 + 100  # type: ignore[attr-defined]
    learner = make(network, schedule(lr=0.01), 2, frozen, grey)
    state = torch.rand(200, 2) * 8 - 4
    data, chosen = observed(learner, batch()), []
    for _ in range(4):
        seen = learner.encoders[FEATURES](state) if learner.encoders else state
        chosen.append(act(learner, seen, 0.0))
        wanted = learner.online_network(grey(state)).argmax(-1)
        assert (chosen[-1] == wanted).float().mean() > 0.98  # ties are rounded either way
        learner.learn_from(data)
    assert not torch.equal(chosen[0], chosen[-1])


def test_evaluations_use_the_average_of_the_online_network() -> None:
    learner = made()
    slow = copy.deepcopy(learner.online_network)
    for _ in range(4):
        learner.learn_from(observed(learner, batch()))
        with torch.no_grad():
            for mine, fast in zip(slow.parameters(), learner.online_network.parameters(), strict=True):
                mine.lerp_(fast, 0.05)
    averages = learner.network.state_dict().values()
    for mine, average, fast in zip(
        slow.parameters(), averages, learner.online_network.parameters(), strict=True
    ):
        torch.testing.assert_close(average, mine)
        assert not torch.equal(average, fast) and not average.requires_grad
    state = torch.rand(5, 2)
    judged = learner.greedy(TensorDict({"state": state}, [5]))
    assert torch.equal(judged["action_value"], learner.network(draw(state)))
    assert torch.equal(judged["action"], judged["action_value"].argmax(-1))
    assert torch.equal(act(learner, state, 0.0), learner.online_network(draw(state)).argmax(-1))


def test_exploration_draws_from_its_own_generator() -> None:
    state = torch.rand(200, 2) * 8 - 4
    actions = [act(made(seed), state, 1.0) for seed in (1, 1, 2)]
    assert torch.equal(actions[0], actions[1]) and not torch.equal(actions[0], actions[2])
    assert set(actions[0].tolist()) == set(range(7))
    torch.manual_seed(0)
    first = act(made(1), state, 0.5)
    torch.manual_seed(1)
    assert torch.equal(first, act(made(1), state, 0.5))


def test_epsilon_is_the_share_of_random_actions() -> None:
    learner = made()
    state = torch.zeros(4000, 2)
    # Before an update both networks are equal.
    greedy = learner.greedy(TensorDict({"state": state[:1]}, [1]))["action"]
    assert torch.equal(act(learner, state, 0.0), greedy.expand(4000))
    other = (act(learner, state, 0.5) != greedy).float().mean()
    assert abs(float(other) - 0.5 * 6 / 7) < 0.04


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


def test_features_are_clamped_to_half_precision() -> None:
    learner = made(frozen=3)
    with torch.no_grad():
        learner.online_network.layers[2].weight.mul_(1e6)
    data = observed(learner, batch())
    assert data["features"].max() == torch.finfo(torch.float16).max
    assert learner.learn_from(data).isfinite() and all(
        p.isfinite().all() for p in learner.online_network.parameters()
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("frozen", [3, 4])
def test_q_values_and_gradients_on_features_equal_those_on_states(frozen: int, seed: int) -> None:
    kept, dense = made(seed, frozen), made_on_states(seed, frozen)
    assert (stored(kept), stored(dense)) == (FEATURES, "state")
    found = []
    for learner in (kept, dense):
        data = observed(learner, batch(32))
        (key,) = learner.loss.value_network_in_keys
        q = learner.online_network(data[key]).detach()
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


def test_freezing_conv1_leaves_conv10_trainable() -> None:
    layers = Network([[4, 8, 4], *([2, 1, 1] for _ in range(9)), [8, 20, 1]], 8)
    network = DuelingNetwork(1, 7, Generator().manual_seed(0), layers)
    make(network, schedule(), frozen=1)
    assert [conv.weight.requires_grad for conv in network.layers] == [False] + 10 * [True]


class Thawing(Method):
    """Freezes two layers for the first half of the episodes."""

    thaws = True

    def frozen_layers(self, progress: float) -> int:
        return 2 if progress < 0.5 else 0


def thawing(seed: int = 3) -> DoubleDQN:
    network = DuelingNetwork(1, 7, Generator().manual_seed(seed))
    exploration, replay = (Generator().manual_seed(seed) for _ in range(2))
    return build(Setup(network, draw, 7, schedule(), exploration, replay, Thawing()))


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


def test_a_penalty_is_added_to_the_loss() -> None:
    class Pull(Method):
        def penalty(self, network: torch.nn.Module, data: TensorDict) -> Tensor:
            return 1e3 * sum((p.square().sum() for p in network.parameters()), torch.zeros(()))

    plain, pulled = made(), made()
    pulled._method = Pull()
    for learner in (plain, pulled):
        learner.learn_from(observed(learner, batch()))
    norms = [
        sum(float(p.detach().norm()) for p in one.online_network.parameters()) for one in (plain, pulled)
    ]
    assert norms[1] < norms[0]
