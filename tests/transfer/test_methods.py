"""Methods of transfer: each does what its definition says."""

from __future__ import annotations

import copy
import math

import pytest
import torch
from tensordict import TensorDict
from torch import Generator, Tensor

from ship_trl.config.arm import Arm
from ship_trl.config.types import Transfer
from ship_trl.learn.double_dqn import build
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.optimiser import ChannelsLastAdam, learning_groups
from ship_trl.sim.state import STEP
from ship_trl.transfer.methods import guide, l2sp, make_method, qdagger, unfreeze
from ship_trl.transfer.methods.base import Origin, TransferMethod, fixed_copy
from ship_trl.transfer.methods.guide import probability
from tests.learn.test_double_dqn import batch, observed
from tests.learn.worlds import draw, fast_setup, schedule

HEAD = ("shared", "value", "advantage")


def network(seed: int) -> DuelingNetwork:
    return DuelingNetwork(1, 7, Generator().manual_seed(seed))


def make(arm: str, settings: Transfer | None = None) -> TransferMethod:
    return make_method(Arm.parse(arm), settings)


def origin(high: float = 1.0, low: float = 0.0, *scales: float) -> Origin:
    source = network(1)
    return Origin(
        fixed_copy(source, source.state_dict()), draw, Generator().manual_seed(0), high, low, *scales
    )


def steps(reward: float, done: bool) -> TensorDict:
    """Return a step of two environments; the second never ends."""
    following = {"reward": torch.tensor([[reward], [7.0]]), "done": torch.tensor([[done], [False]])}
    return TensorDict({"next": TensorDict(following, [2])}, [2])


@pytest.mark.parametrize(
    ("arm", "copied"),
    [
        ("FTH", HEAD),
        ("FEH", HEAD),
        ("FTB", ("conv1", "conv2", "conv3", "conv4", "shared")),
        ("SP2", ("conv1", "conv2")),
        ("G", ()),
        ("QDW", ("conv1", "conv2", "conv3", "conv4", *HEAD)),
    ],
)
def test_the_layers_of_the_arm_are_copied(arm: str, copied: tuple[str, ...]) -> None:
    target, source = network(0), network(1)
    before = {key: value.clone() for key, value in target.named_parameters()}
    make(arm).copy(target, source.state_dict())
    for key, value in target.named_parameters():
        taken = source if key.split(".")[0] in copied else None
        assert torch.equal(value, before[key] if taken is None else source.state_dict()[key]), key


def learn(method: TransferMethod, updates: int) -> tuple[DuelingNetwork, dict[str, Tensor]]:
    """Copy from a source and learn; return the network, and its weights before."""
    target = network(0)
    method.copy(target, network(1).state_dict())
    start = {key: value.detach().clone() for key, value in target.named_parameters()}
    exploration, replay = (Generator().manual_seed(seed) for seed in (1, 2))
    learner = build(fast_setup(target, draw, 7, schedule(), exploration, replay, method))
    for _ in range(updates):
        learner.learn_from(observed(learner, batch()))
    return target, start


def test_a_frozen_head_keeps_its_bytes_while_conv_layers_learn() -> None:
    target, start = learn(make("FEH"), 3)
    for key, value in target.named_parameters():
        assert torch.equal(start[key], value) == key.startswith(HEAD), key


def test_the_pull_is_half_the_squared_change() -> None:
    target, source = network(0), network(1)
    method = make("SP1", Transfer(l2sp=l2sp.Settings(copied=0.5, fresh=0.25)))
    method.copy(target, source.state_dict())
    with torch.no_grad():
        target.layers[0].bias += 2.0
    fresh = [value for key, value in target.named_parameters() if not key.startswith("conv1")]
    wanted = 0.25 * 4.0 * 32 + 0.125 * sum(float(value.detach().square().sum()) for value in fresh)
    found = method.penalty(target, batch())
    assert found is not None and float(found.detach()) == pytest.approx(wanted, rel=1e-5)


def test_the_probability_of_the_guide() -> None:
    step = torch.tensor([0.0, 1.0, 9.0, 10.0])

    def chances(progress: float, schedule: str) -> list[float]:
        settings = guide.Settings(guide.Schedule(schedule), belief=0.8, period=0.5, decay=0.5, steps=20)
        return [round(chance, 4) for chance in probability(settings, progress, step).tolist()]

    assert chances(0.0, "belief") == 4 * [0.8] and chances(0.25, "belief") == 4 * [0.4]
    assert chances(0.0, "reuse") == [0.8, 0.4, 0.0016, 0.0008] == chances(0.49, "reuse")
    assert chances(0.0, "jumpstart") == 4 * [1.0] and chances(0.25, "jumpstart") == [1.0, 1.0, 1.0, 0.0]
    assert all(chances(0.5, one.value) == 4 * [0.0] for one in guide.Schedule)


def test_the_source_chooses_as_often_as_it_is_believed() -> None:
    method, count = make("G", Transfer(guide=guide.Settings(belief=0.6, period=1.0))), 2000
    method.attach(origin())
    state = torch.rand(count, STEP + 1, generator=Generator().manual_seed(3)) * 8 - 4
    step = TensorDict({"state": state, "action": torch.full((count,), -1)}, [count])
    method.act(step, 0.5)
    guided = step["action"] >= 0
    assert float(guided.float().mean()) == pytest.approx(0.3, abs=4 * math.sqrt(0.3 * 0.7 / count))
    best = network(1)(draw(state)).argmax(-1)
    assert torch.equal(step["action"][guided], best[guided])
    # Under a mask it names an allowed action.
    step["action"], step["action_mask"] = torch.full((count,), -1), torch.arange(7) != best[:, None]
    method.act(step, 0.5)
    assert bool((step["action"] >= 0).any()) and not bool((step["action"] == best).any())


def test_the_divergence_is_that_of_the_two_policies_and_fades() -> None:
    method, target, data = (
        make("QD", Transfer(qdagger=qdagger.Settings(weight=2.0, temperature=0.5))),
        network(0),
        batch(),
    )
    # Q-values in raw rewards: the source's rewards were scaled by a half, the target's are by a quarter.
    method.attach(origin(10.0, -10.0, 0.5, 0.25))
    data["pixels"] = draw(data["state"])
    p, q = (
        (net(data["pixels"]) / scale / 0.5).softmax(-1) for net, scale in ((network(1), 0.5), (target, 0.25))
    )
    wanted = float((p * (p / q).log()).sum(-1).mean().detach())
    found = method.penalty(target, data)
    assert found is not None and float(found.detach()) == pytest.approx(2.0 * wanted, rel=1e-4)
    # The first environment's returns are 5 and -5, so the mean is half way.
    for reward, done in ((2.0, False), (3.0, True), (-5.0, True)):
        method.observe(steps(reward, done))
    found = method.penalty(target, data)
    assert found is not None and float(found.detach()) == pytest.approx(wanted, rel=1e-4)
    other = make("QD")
    other.attach(origin(high=10.0, low=-10.0))
    other.load_state_dict(method.state_dict())
    other.observe(steps(25.0, True))
    method.observe(steps(25.0, True))
    for one in (method, other):
        assert all(torch.equal(value, method.state_dict()[key]) for key, value in one.state_dict().items())
    for _ in range(3):
        method.observe(steps(100.0, True))
    assert method.penalty(target, data) is None


@pytest.mark.parametrize(
    ("arm", "shares"),
    [("SP3", (3, 2, 1, 0, 0, 0, 0)), ("SPW", (5, 4, 3, 2, 1, 0, 0)), ("SPH", (0, 0, 0, 0, 1, 0, 0))],
)
def test_a_copied_layer_learns_slower_than_the_one_above_it(arm: str, shares: tuple[int, ...]) -> None:
    method, target = make(arm, Transfer(l2sp=l2sp.Settings(rate_decay=2.6))), network(0)
    method.copy(target, network(1).state_dict())
    optimiser = ChannelsLastAdam(learning_groups(target, method.rate_factor), lr=0.01)
    optimiser.set_lr(0.1)
    before = copy.deepcopy(target)
    for parameter in target.parameters():
        parameter.grad = torch.ones_like(parameter)
    optimiser.step()
    for name, share in zip(target.all_layers, shares, strict=True):
        change = getattr(before, name).weight - getattr(target, name).weight
        assert float(change.detach().mean()) == pytest.approx(0.1 / 2.6**share, rel=1e-3), name


@pytest.mark.parametrize(("arm", "count"), [("GU3", 3), ("GUW", 4)])
def test_copied_layers_thaw_from_the_last_one_down(arm: str, count: int) -> None:
    method = make(arm, Transfer(unfreeze=unfreeze.Settings(period=0.5)))
    method.copy(network(0), network(1).state_dict())
    found = [
        method.frozen_layers(progress) for progress in (0.0, *((k + 0.01) / count / 2 for k in range(1, 6)))
    ]
    assert found == [count, *(max(0, count - k) for k in range(1, 6))]
