"""Every peer learns, keeps frozen layers as they are, and computes the same double-DQN target."""

import copy
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torchrl.data import Categorical
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ship_trl.bench.learning import PEERS as UNFROZEN
from ship_trl.bench.learning import SB3, Peer
from ship_trl.bench.ours import ARMS, Ours, frozen_layers
from ship_trl.bench.peer_loops import PlainLoop, TunedLoop
from ship_trl.bench.peer_network import PlainNetwork, TunedNetwork, blocks
from ship_trl.bench.peer_sb3 import DoubleDQN, Sb3Loop
from ship_trl.bench.peer_torchrl import TorchRLLoop
from ship_trl.bench.pygame_env import PygameShipEnv
from ship_trl.bench.work import learn_config
from ship_trl.config.types import Learn
from ship_trl.gym.env import ShipCollisionEnv
from ship_trl.sim.cases import load_case, load_world

Build = Callable[..., Peer]


def short(**changes: Any) -> Learn:
    return learn_config(**({"replay_size": 64, "warmup_steps": 16, "batch_size": 8} | changes))


def make_env() -> gymnasium.Env[Any, Any]:
    world = load_world()
    return PygameShipEnv(load_case("4", world), world, 0.01)


def changed(network: nn.Module, before: nn.Module) -> dict[str, bool]:
    pairs = zip(network.named_parameters(), before.parameters(), strict=True)
    return {name: not torch.equal(now, old) for (name, now), old in pairs}


@pytest.mark.parametrize("frozen", [0, 2, 4])
@pytest.mark.parametrize(
    "build",
    [Sb3Loop, PlainLoop, TorchRLLoop, TunedLoop, partial(TunedLoop, bf16=True)],
    ids=["sb3", "single-file", "torchrl", "tuned", "bf16"],
)
def test_a_peer_learns_all_but_its_frozen_layers(build: Build, frozen: int) -> None:
    peer = build(make_env(), short(), frozen=frozen)
    before = copy.deepcopy(peer.network)
    peer.run(16)
    assert not any(changed(peer.network, before).values())
    assert peer.run(24) == 24
    fixed = tuple(f"convs.{k}." for k in range(frozen))
    for name, moved in changed(peer.network, before).items():
        held = any(part in f".{name}" for part in (f".{start}" for start in fixed))
        assert moved != held, name


def test_the_librarys_own_dqn_learns() -> None:
    peer = UNFROZEN[SB3](make_env(), short())
    assert isinstance(peer, Sb3Loop) and not isinstance(peer.model, DoubleDQN)
    before = copy.deepcopy(peer.network)
    peer.run(32)
    assert all(changed(peer.network, before).values())
    with pytest.raises(TypeError, match="double"):
        peer.update(peer.sample())


@pytest.mark.parametrize("name", UNFROZEN)
def test_peers_take_either_environment(name: str) -> None:
    env = ShipCollisionEnv("4", reward_scale=0.01)
    assert UNFROZEN[name](env, short()).run(24) == 24


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
        assert torch.allclose(plain(pixels), tuned(blocks(pixels[:, 0])), atol=1e-5)


class Whole(nn.Module):
    """A Q-network of the library as a plain module."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.inner = network

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.inner(observation)


def test_double_target_is_torchrls() -> None:
    peer = Sb3Loop(make_env(), short())
    peer.run(60)
    model = peer.model
    assert isinstance(model, DoubleDQN)
    with torch.no_grad():
        for parameter in model.q_net_target.parameters():
            parameter.add_(torch.randn_like(parameter) * 0.02)
    batch = peer.sample()
    wanted = model.td_target(batch)[:, 0]
    # DQNLoss copies the target from the network it is given, so that one is target first, online then.
    online = copy.deepcopy(model.q_net.state_dict())
    model.q_net.load_state_dict(model.q_net_target.state_dict())
    actor = QValueActor(Whole(model.q_net), in_keys=["pixels"], spec=Categorical(7))
    loss = DQNLoss(actor, delay_value=True, double_dqn=True, loss_function="l2", reduction="none")
    loss.make_value_estimator(gamma=model.gamma)
    SoftUpdate(loss, tau=model.tau)
    model.q_net.load_state_dict(online)
    done = batch.dones.bool()
    following = {"pixels": batch.next_observations, "reward": batch.rewards, "done": done, "terminated": done}
    data = TensorDict(
        {"pixels": batch.observations, "action": batch.actions[:, 0], "next": following}, [len(done)]
    )
    squared = loss(data)["loss"].flatten()
    with torch.no_grad():
        value = model.q_net(batch.observations).gather(1, batch.actions)[:, 0]
    assert torch.allclose((value - wanted).square(), squared, rtol=1e-3, atol=1e-6)
    # Not by chance: the simple target is another one.
    with torch.no_grad():
        best = model.q_net_target(batch.next_observations).amax(1, keepdim=True)
    simple = (batch.rewards + (1 - batch.dones) * model.gamma * best)[:, 0]
    assert not torch.allclose((value - simple).square(), squared, rtol=1e-3, atol=1e-6)


@pytest.mark.precision
@pytest.mark.parametrize("arm", ARMS)
def test_our_arms_learn_all_but_their_frozen_layers(arm: str) -> None:
    ours = Ours(arm, learn=short())
    before = copy.deepcopy(ours.network)
    run = ours.whole_loop(chunk=8)
    assert run() >= 8
    for name, moved in changed(ours.network, before).items():
        assert moved != (name[:5] in [f"conv{k + 1}" for k in range(frozen_layers(arm))]), name


@pytest.mark.precision
def test_our_parts_run() -> None:
    ours = Ours(learn=short())
    ours.fill(16)
    before = copy.deepcopy(ours.network)
    ours.update(ours.sample())
    assert any(changed(ours.network, before).values())
    assert ours.act(ours.states(4)).shape == (4,) and ours.precision in ("fp32", "bf16")
