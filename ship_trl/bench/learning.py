"""Probes of learning: whole loops, frozen layers, one update, replay, growth."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium

from ship_trl.bench.flops import forward_flops, update_flops
from ship_trl.bench.ours import ARMS, Ours, frozen_layers, network_layers
from ship_trl.bench.peer_loops import PlainLoop, TunedLoop
from ship_trl.bench.peer_sb3 import Sb3Loop
from ship_trl.bench.peer_torchrl import TorchRLLoop
from ship_trl.bench.simulator import MakeEnv
from ship_trl.bench.timing import Probe, Timing
from ship_trl.bench.work import CHUNK, WARMUP, learn_config
from ship_trl.config.types import Learn

Peer = Sb3Loop | PlainLoop | TunedLoop | TorchRLLoop
SINGLE_FILE, TUNED, TUNED_BF16 = "single-file script", "tuned PyTorch, fp32", "tuned PyTorch, bf16"
SB3, SB3_DOUBLE, TORCHRL = "SB3 DQN as it is", "SB3, double dueling", "TorchRL's usual way"
PEERS: dict[str, Callable[[gymnasium.Env[Any, Any], Learn], Peer]] = {
    SB3: lambda env, learn: Sb3Loop(env, learn, double=False),
    SB3_DOUBLE: Sb3Loop,
    SINGLE_FILE: PlainLoop,
    TORCHRL: TorchRLLoop,
    TUNED: TunedLoop,
    TUNED_BF16: lambda env, learn: TunedLoop(env, learn, bf16=True),
}
OUR_LOOP, OUR_UPDATE = "ours", "ours"
# Pictures the network decides on at once in a run of ours.
ACTING = 4


def precision(name: str) -> str:
    """Return what a peer computes in."""
    return "bf16" if name == TUNED_BF16 else "fp32"


def step_flops(learn: Learn, frozen: int = 0, double: bool = True) -> float:
    """Operations of one environment step of a loop: its share of an update, and acting."""
    layers = network_layers()
    update = update_flops(layers, learn.batch_size, frozen, double) / learn.update_every
    return update + (1 - learn.epsilon_end) * forward_flops(layers, 1)


def warmed(peer: Peer, chunk: int = CHUNK) -> Callable[[], int]:
    """Return a peer's loop behind its warm-up."""
    peer.run(WARMUP)
    return lambda: peer.run(chunk)


def our_loop(name: str, arm: str = "scratch", num_envs: int = 1, group: str = "") -> Probe:
    """Our whole loop, behind its warm-up."""
    ours = Ours(arm, learn=learn_config(num_envs=num_envs))
    flops = step_flops(ours.learn, frozen_layers(arm))
    run = ours.whole_loop()
    return Probe(name, run, group=group, ours=True, flops=flops, precision=ours.precision)


def loop_probes(make_env: MakeEnv) -> list[Probe]:
    """Whole training loops: ours and every peer's; a unit is an environment step."""
    learn = learn_config()
    return [
        our_loop(OUR_LOOP),
        our_loop("ours, 4 environments", num_envs=4),
        *(
            Probe(
                name,
                warmed(build(make_env(), learn)),
                flops=step_flops(learn, double=name != SB3),
                precision=precision(name),
            )
            for name, build in PEERS.items()
        ),
    ]


def frozen_probes(make_env: MakeEnv) -> list[Probe]:
    """Our arms beside two peers with as many frozen layers; a unit is an environment step."""
    learn, probes = learn_config(), []
    for arm in ARMS:
        frozen = frozen_layers(arm)
        flops = step_flops(learn, frozen)
        slow = warmed(Sb3Loop(make_env(), learn, frozen=frozen))
        quick = warmed(TunedLoop(make_env(), learn, frozen=frozen, bf16=True))
        probes += [
            our_loop(f"ours, {arm}", arm, group=arm),
            Probe(f"SB3, {frozen} layers frozen", slow, group=arm, flops=flops),
            Probe(f"{TUNED_BF16}, {frozen} frozen", quick, group=arm, flops=flops, precision="bf16"),
        ]
    return probes


def one(action: Callable[[], object], units: int = 1) -> Callable[[], int]:
    """Make a probe's run of something that does `units` units."""

    def run() -> int:
        action()
        return units

    return run


def filled(make_env: MakeEnv, learn: Learn) -> dict[str, Peer]:
    """Every peer with enough in its replay to sample from, before its first update."""
    peers = {name: build(make_env(), learn) for name, build in PEERS.items() if name != SB3}
    for peer in peers.values():
        peer.run(WARMUP)
    return peers


def replay_probes(make_env: MakeEnv) -> list[Probe]:
    """Probe sampling of a batch as the learner gets it, ours drawn on the way; a unit is a batch."""
    ours = Ours()
    ours.fill(WARMUP)
    probes = [Probe("ours, states drawn", one(ours.sample), "batch", ours=True)]
    for name, peer in filled(make_env, ours.learn).items():
        if name != TUNED_BF16:
            probes.append(Probe(f"{name}, pixels", one(peer.sample), "batch"))
    return probes


def update_probes(make_env: MakeEnv) -> list[Probe]:
    """One update on one batch, acting on four states, and our whole loop; units differ by group."""
    ours = Ours()
    ours.fill(WARMUP)
    layers, size = network_layers(), ours.learn.batch_size
    flops, group = update_flops(layers, size), "one update"
    batch, states = ours.sample(), ours.states(ACTING)
    probes = [
        Probe(OUR_UPDATE, one(partial(ours.update, batch)), "update", group, True, flops, ours.precision)
    ]
    for name, peer in filled(make_env, ours.learn).items():
        same: Any = peer.sample()
        act = one(partial(peer.update, same))
        probes.append(Probe(name, act, "update", group, False, flops, precision(name)))
    for arm in ARMS[1:]:
        other = Ours(arm)
        other.fill(WARMUP)
        less = update_flops(layers, size, frozen_layers(arm))
        act = one(partial(other.update, other.sample()))
        probes.append(Probe(f"ours, {arm}", act, "update", group, True, less, other.precision))
    acting = forward_flops(layers, ACTING)
    run = one(partial(ours.act, states))
    name = f"ours, drawing and network on {ACTING}"
    # Decisions are made in float32, whatever learning computes in.
    probes.append(Probe(name, run, "call", "acting", True, acting, "fp32"))
    return [*probes, our_loop(OUR_LOOP, group="whole loop")]


def overhead(timings: list[Timing]) -> float:
    """Time of the whole loop for one update, in bare updates."""
    rate = {(t.probe.group, t.probe.name): t.rate for t in timings}
    per_update = learn_config().update_every / rate["whole loop", OUR_LOOP]
    return per_update * rate["one update", OUR_UPDATE]


def growth_probes() -> list[Probe]:
    """Our whole loop by environments, and one update by batch size."""
    counts = (1, 4, 16, 64)
    probes = [our_loop(f"ours, environments: {n}", num_envs=n, group="whole loop") for n in counts]
    for size in (8, 32, 128):
        ours = Ours(learn=learn_config(batch_size=size))
        ours.fill(WARMUP)
        batch = ours.sample()
        run = one(partial(ours.update, batch), size)
        flops = update_flops(network_layers(), size) / size
        name = f"ours, update of {size}"
        probes.append(Probe(name, run, "transition", "batch size", True, flops, ours.precision))
    return probes
