"""The loss equals TorchRL's DQNLoss in every bit, and reads batches of its replay."""

from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Generator
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl.config.network import geometry, load_network
from ship_trl.config.types import Loss
from ship_trl.fast.incremental import Incremental
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.q_learning import DoubleDQNLoss, td_loss
from ship_trl.learn.replay import DrawStates, StateReplay
from tests.learn.worlds import draw

PAPER = geometry(load_network())


def actor(frozen: int = 0) -> QValueActor:
    network = DuelingNetwork(1, 7, Generator().manual_seed(3))
    network.freeze(frozen)
    return QValueActor(network, in_keys=["pixels"], action_space="categorical")


def reference(value_network: QValueActor, kind: Loss) -> DQNLoss:
    made = DQNLoss(
        value_network,
        double_dqn=True,
        action_space="categorical",
        loss_function="l2" if kind is Loss.l2 else "smooth_l1",
    )
    made.make_value_estimator(gamma=0.9)
    return made


def made(value_network: QValueActor, **how: Any) -> DoubleDQNLoss:
    loss = DoubleDQNLoss(value_network, gamma=0.9, **how)
    SoftUpdate(loss, tau=0.1)  # without an updater TorchRL warns
    return loss


def test_each_named_loss_has_a_formula() -> None:
    q, td_target = torch.tensor([[1.0], [4.0]]), torch.tensor([[0.5], [0.0]])
    assert td_loss(q, td_target, Loss.l2).item() == pytest.approx((0.25 + 16) / 2)
    assert td_loss(q, td_target, Loss.huber, 2.0).item() == pytest.approx((0.125 + 2 + 4) / 2)
    for kind in Loss:
        assert td_loss(q, td_target, kind) > td_loss(q, q, kind)
    other = type("Other", (), {"name": "cauchy"})()
    with pytest.raises(ValueError, match="no formula for cauchy"):
        td_loss(q, td_target, other)


def batch(size: int = 12) -> TensorDict:
    generator = Generator().manual_seed(4)
    state, later = torch.rand(2, size, 2, generator=generator) * 8 - 4
    following = {
        "pixels": draw(later),
        "reward": torch.rand(size, 1, generator=generator) * 4,
        "done": torch.ones(size, 1, dtype=torch.bool),
        "terminated": torch.arange(size)[:, None] % 3 == 0,
    }
    action = torch.randint(7, (size,), generator=generator)
    return TensorDict({"pixels": draw(state), "action": action, "next": following}, batch_size=[size])


@pytest.mark.parametrize("kind", list(Loss))
@pytest.mark.parametrize("frozen", [0, 2])
def test_loss_gradients_td_error_and_targets_equal_torchrls(kind: Loss, frozen: int) -> None:
    found = []
    for make in (lambda a: DoubleDQNLoss(a, kind=kind, gamma=0.9), lambda a: reference(a, kind)):
        loss, data = make(actor(frozen)), batch()
        target, values = SoftUpdate(loss, tau=0.1), []
        optimiser = torch.optim.SGD([p for p in loss.parameters() if p.requires_grad], lr=0.001)
        for _ in range(3):  # after the first step online and target network differ
            value = loss(data)["loss"]
            optimiser.zero_grad()
            value.backward()
            values += [value.detach(), data["td_error"].flatten().clone()]
            values += [p.grad.clone() for p in loss.parameters() if p.grad is not None]
            optimiser.step()
            target.step()
        values += list(loss.target_value_network_params.flatten_keys(".").values())
        found.append(values)
    assert len(found[0]) == len(found[1]) == 3 * (2 + 14 - 2 * frozen) + 14
    for mine, other in zip(*found, strict=True):
        assert torch.equal(mine, other)


def test_keys_equal_torchrls() -> None:
    mine, other = made(actor()), reference(actor(), Loss.l2)
    assert set(mine.in_keys) == set(other.in_keys) and mine.out_keys == other.out_keys
    data = batch()
    by_name = mine(
        pixels=data["pixels"],
        action=data["action"],
        next_pixels=data["next", "pixels"],
        next_reward=data["next", "reward"],
        next_done=data["next", "done"],
        next_terminated=data["next", "terminated"],
    )
    assert torch.equal(by_name, mine(data)["loss"])


@pytest.mark.parametrize("frozen", [0, 2])
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_changed_weights_invalidate_the_cache(frozen: int, dtype: torch.dtype) -> None:
    value_network = actor(frozen)
    value_network[0].module.backend = Incremental(draw.background, dtype, PAPER)
    loss, data = DoubleDQNLoss(value_network, gamma=0.9), batch()
    target = SoftUpdate(loss, tau=0.5)
    learning = [p for p in loss.parameters() if p.requires_grad]
    optimiser = torch.optim.Adam(learning, lr=0.01, fused=True)
    seen = []
    for _ in range(3):
        optimiser.zero_grad()
        loss(data)["loss"].backward()
        optimiser.step()
        target.step()
        module = loss.value_network[0].module
        for network in (loss.network, loss.target_network):
            kept = module.backend
            with torch.no_grad():
                seen.append(network(data["pixels"]))
                module.backend = Incremental(draw.background, dtype, PAPER)
                assert torch.equal(seen[-1], network(data["pixels"]))
            module.backend = kept
    assert all(not torch.equal(a, b) for k, a in enumerate(seen) for b in seen[:k])


def test_torchrls_loss_reads_our_replay() -> None:
    generator, device = Generator().manual_seed(0), torch.device("cpu")
    memory = StateReplay(50, 0.01, generator, device, transform=DrawStates(draw))
    given = batch(40).exclude("pixels", ("next", "pixels"))
    given["state"], given["next", "state"] = torch.rand(2, 40, 2) * 8 - 4
    memory.extend(given)
    sample, value_network = memory.sample(16), actor()
    other = reference(value_network, Loss.l2)
    SoftUpdate(other, tau=0.1)
    assert torch.equal(made(value_network)(sample)["loss"], other(sample)["loss"])


@pytest.mark.parametrize("frozen", [0, 2])
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_a_loaded_loss_computes_with_the_loaded_weights(frozen: int, dtype: torch.dtype) -> None:
    value_network, other = actor(frozen), made(actor(frozen))
    value_network[0].module.backend = Incremental(draw.background, dtype, PAPER)
    loss, pixels = made(value_network), batch()["pixels"]
    with torch.no_grad():
        for parameter in other.parameters():
            parameter.mul_(1.5)
        loss.network(pixels), loss.target_network(pixels)
        loss.load_state_dict(other.state_dict())
        pairs = ((loss.network, other.network), (loss.target_network, other.target_network))
        for mine, theirs in pairs:
            wanted = theirs(pixels)
            assert (mine(pixels) - wanted).abs().max() < 0.03 * wanted.abs().max()
