"""The double-DQN update, exploration, freezing, and the soft target."""

import copy
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Generator, Tensor

from ship_trl.config.types import Learn, Loss
from ship_trl.learn.double_dqn import FEATURES, DoubleDQN, build
from ship_trl.learn.hooks import LearningHooks
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.replay import DrawStates
from tests.learn.worlds import Freezing, draw, fast_setup, schedule


def make(
    network: DuelingNetwork, learn: Learn, seed: int = 0, frozen: int = 0, draw: Any = draw
) -> DoubleDQN:
    exploration, replay = (Generator().manual_seed(seed) for _ in range(2))
    return build(fast_setup(network, draw, 7, learn, exploration, replay, Freezing(frozen)))


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
        pixels: TensorDict = DrawStates(draw)(data)
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


def test_a_penalty_is_added_to_the_loss() -> None:
    class Pull(LearningHooks):
        def penalty(self, network: torch.nn.Module, data: TensorDict) -> Tensor:
            return 1e3 * sum((p.square().sum() for p in network.parameters()), torch.zeros(()))

    plain, pulled = made(), made()
    pulled.method = Pull()
    for learner in (plain, pulled):
        learner.learn_from(observed(learner, batch()))
    norms = [
        sum(float(p.detach().norm()) for p in one.online_network.parameters()) for one in (plain, pulled)
    ]
    assert norms[1] < norms[0]
