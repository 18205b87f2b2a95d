"""Every learner that is timed learns, and keeps its frozen layers."""

import copy

import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torchrl.data import Categorical
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from benchmarks.learning import peer_loop
from benchmarks.ours import learn_config, make_ours
from benchmarks.peers import PEERS, PlainNetwork, TunedLoop, TunedNetwork, make_peer, to_blocks
from benchmarks.timing import measure
from ship_trl.config.arm import Arm
from ship_trl.config.types import BFLOAT16

SHORT = ("learn.replay_size=300", "learn.batch_size=8")


def changed(network: nn.Module, before: nn.Module) -> dict[str, bool]:
    pairs = zip(network.named_parameters(), before.parameters(), strict=True)
    return {name: not torch.equal(now, old) for (name, now), old in pairs}


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_learns_all_but_its_frozen_layers(name: str) -> None:
    peer = make_peer(name, learn_config(*SHORT), frozen=3)
    before = copy.deepcopy(peer.network)
    (found,) = measure([peer_loop("", name, peer)], rounds=1, seconds=0.01)
    assert found.values[0] > 0
    fixed = tuple(f"convs.{k}." for k in range(3))
    for key, moved in changed(peer.network, before).items():
        assert moved != any(f".{start}" in f".{key}" for start in fixed), key


def test_the_tuned_loss_is_torchrls() -> None:
    peer = make_peer("tuned PyTorch, fp32", learn_config(*SHORT))
    assert isinstance(peer, TunedLoop)
    batch, target = peer.sample(), peer.target.state_dict()
    for value in target.values():
        value += 0.02 * torch.randn_like(value)
    # DQNLoss copies its target network from the network it is given, which becomes the online one afterwards.
    network = copy.deepcopy(peer.target).requires_grad_(True)
    actor = QValueActor(network, in_keys=["pixels"], spec=Categorical(7))
    loss = DQNLoss(actor, delay_value=True, double_dqn=True, loss_function="l2")
    loss.make_value_estimator(gamma=peer.learn.gamma)
    SoftUpdate(loss, tau=peer.learn.tau)
    network.load_state_dict(peer.network.state_dict())
    done = batch.terminated[:, None].bool()
    after = {"pixels": batch.next_pixels, "reward": batch.reward[:, None], "done": done, "terminated": done}
    data = TensorDict({"pixels": batch.pixels, "action": batch.action, "next": after}, [len(done)])
    wanted = loss(data)["loss"]
    assert torch.allclose(peer.loss(batch), wanted, rtol=1e-3, atol=1e-6)
    # Not by chance: another target network gives another loss.
    peer.target.load_state_dict(peer.network.state_dict())
    assert not torch.allclose(peer.loss(batch), wanted, rtol=1e-3, atol=1e-6)


def test_tuned_network_is_the_plain_one() -> None:
    plain, tuned = PlainNetwork(7), TunedNetwork(7)
    state = plain.state_dict()
    first, last = state["convs.0.weight"], state["convs.3.weight"]
    # 8x8 as 2x2 blocks of 4x4; 7x7 with channels last.
    state["convs.0.weight"] = first.reshape(32, 2, 4, 2, 4).permute(0, 2, 4, 1, 3).reshape(32, 16, 2, 2)
    state["convs.3.weight"] = last.permute(0, 2, 3, 1).flatten(1)
    tuned.load_state_dict(state)
    pixels = torch.randint(256, (3, 1, 84, 84), dtype=torch.uint8)
    with torch.no_grad():
        assert torch.allclose(plain(pixels), tuned(to_blocks(pixels[:, 0])), atol=1e-5)


@pytest.mark.parametrize("switch", ["on", "off"])
@pytest.mark.parametrize("arm", ["scratch", "FE3", "FT3"])
def test_our_arms_learn_all_but_their_frozen_layers(
    arm: str, switch: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(BFLOAT16, switch)
    ours = make_ours(arm, "learn.warmup_steps=16", *SHORT)
    before = copy.deepcopy(ours.algorithm.online_network)
    ours.train(24)
    frozen = [f"conv{k + 1}" for k in range(Arm.parse(arm).frozen_layers)]
    for name, moved in changed(ours.algorithm.online_network, before).items():
        assert moved != (name.split(".")[0] in frozen), name
