"""Probes of learning: whole loops, frozen layers, one update.

The peers learn in ship_trl's Gymnasium environment. It is faster than the pygame one, and one step of
either is about a hundredth of a step of the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from benchmarks.ours import ARMS, frozen_layers, make_ours, start_loop
from benchmarks.peer_sb3 import Sb3Loop
from benchmarks.peer_torchrl import TorchRLLoop
from benchmarks.peer_tuned import TunedLoop
from benchmarks.timing import Probe
from benchmarks.work import CASE, STEPS_PER_CALL, WARMUP_STEPS, learn_config
from ship_trl.config.types import Learn
from ship_trl.gym import ShipCollisionEnv

Peer = Sb3Loop | TorchRLLoop | TunedLoop
SB3, TUNED_BF16 = "SB3 DQN as it is", "tuned PyTorch, bf16"
# Each takes an environment, hyperparameters, and the number of frozen conv layers.
PEERS: dict[str, Callable[..., Peer]] = {
    SB3: Sb3Loop,
    "TorchRL's usual way": TorchRLLoop,
    "tuned PyTorch, fp32": TunedLoop,
    TUNED_BF16: partial(TunedLoop, bf16=True),
}


def make_peer(name: str, learn: Learn, frozen: int = 0) -> Peer:
    """Make a peer and run it through its warm-up, so that its next step learns."""
    peer = PEERS[name](ShipCollisionEnv(CASE, reward_scale=learn.reward_scale), learn, frozen=frozen)
    peer.run(WARMUP_STEPS)
    return peer


def our_loop(group: str, name: str, arm: str = "scratch", num_envs: int = 1) -> Probe:
    """Return the probe of ship_trl's whole loop, behind its warm-up."""
    run = start_loop(make_ours(arm, f"learn.num_envs={num_envs}"))
    return Probe(group, name, run, STEPS_PER_CALL, is_ours=True)


def peer_loop(group: str, name: str, peer: Peer) -> Probe:
    """Return the probe of a peer's whole loop."""
    return Probe(group, name, partial(peer.run, STEPS_PER_CALL), STEPS_PER_CALL)


def loop_probes() -> list[Probe]:
    """Return whole training loops, a unit being an environment step."""
    return [
        *(peer_loop("", name, make_peer(name, learn_config())) for name in PEERS),
        our_loop("", "ours"),
        our_loop("", "ours, 4 environments", num_envs=4),
    ]


def frozen_probes() -> list[Probe]:
    """Return the loop of every arm beside two peers that freeze as many layers."""
    learn, probes = learn_config(), []
    for arm in ARMS:
        frozen = frozen_layers(arm)
        probes += [
            peer_loop(arm, f"{name}, {frozen} frozen", make_peer(name, learn, frozen))
            for name in (SB3, TUNED_BF16)
        ]
        probes.append(our_loop(arm, f"ours, {arm}", arm))
    return probes


def vector_probes() -> list[Probe]:
    """Return the loop on numbers, with an update every 16 environment steps."""
    words = ("observation=vector", "learn.num_envs=64", "learn.batch_size=128", "learn.update_every=16")
    return [
        Probe("", "ours, numbers", start_loop(make_ours("scratch", *words)), STEPS_PER_CALL, is_ours=True)
    ]


def update_probes() -> list[Probe]:
    """Return one update of each learner, on a batch that stays the same (Stable-Baselines3 draws its own)."""
    probes = []
    for name in PEERS:
        peer = make_peer(name, learn_config())
        update = peer.update if isinstance(peer, Sb3Loop) else partial(peer.update, peer.sample())
        probes.append(Probe("", name, update, unit="update"))
    for arm in ARMS:
        ours = make_ours(arm)
        ours.fill(WARMUP_STEPS)
        run = partial(ours.algorithm.learn_from, ours.sample())
        probes.append(Probe("", f"ours, {arm}", run, unit="update", is_ours=True))
    return probes
