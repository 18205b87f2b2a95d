"""Probes of learning: whole loops, frozen layers, one update, many agents; beside peers, or on a GPU.

Rows named "operation by operation" do the same work without CUDA graphs (`fast=false`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks.ours import (
    ARMS,
    CASE,
    STEPS_PER_CALL,
    WARMUP_STEPS,
    Ours,
    learn_config,
    make_ours,
)
from benchmarks.peers import PEERS, SB3, TUNED_BF16, Peer, Sb3Loop, make_peer
from benchmarks.timing import Probe
from ship_trl.config.arm import Arm
from ship_trl.run.lockstep import make_lockstep, starts
from studies.lockstep import Task
from studies.sources.plan import SETTINGS

KINDS = {"fast=true": "ours", "fast=false": "ours, operation by operation"}
GPU_BATCHES = (32, 256, 2048)
# Agents in lockstep, and environment steps that they take for their graphs to be captured.
AGENTS, CAPTURE_STEPS = (1, 20, 80, 320), 50
# Updates in one call of a probe on a GPU, and of agents in lockstep.
UPDATES, AGENT_UPDATES = 8, 16


def our_loop(group: str, name: str, arm: str = "scratch", *words: str) -> Probe:
    """Return the probe of ship_trl's whole loop, behind its warm-up."""
    ours = make_ours(arm, *words)
    ours.train(ours.learn.warmup_steps)
    return Probe(group, name, partial(ours.train, STEPS_PER_CALL), STEPS_PER_CALL, is_ours=True)


def peer_loop(group: str, name: str, peer: Peer) -> Probe:
    """Return the probe of a peer's whole loop."""
    return Probe(group, name, partial(peer.run, STEPS_PER_CALL), STEPS_PER_CALL)


def loop_probes(device: str) -> list[Probe]:
    """Return whole training loops, a unit being an environment step."""
    if device == "cpu":
        return [
            *(peer_loop("", name, make_peer(name, learn_config())) for name in PEERS),
            our_loop("", "ours"),
            our_loop("", "ours, 4 environments", "scratch", "learn.num_envs=4"),
        ]
    on, many = f"device={device}", "learn.num_envs=64"
    large = "learn.batch_size=512", "learn.update_every=64"
    return [
        peer_loop("", SB3, make_peer(SB3, learn_config(), device=device)),
        *(our_loop("", name, "scratch", on, kind) for kind, name in KINDS.items()),
        our_loop("", "ours, FE3", "FE3", on),
        our_loop("", "ours, 64 environments, an update every 4 steps", "scratch", on, many),
        our_loop("", "ours, 64 environments, batches of 512 every 64", "scratch", on, many, *large),
    ]


def frozen_probes(_: str) -> list[Probe]:
    """Return the loop of every arm beside two peers that freeze as many layers."""
    learn, probes = learn_config(), []
    for arm in ARMS:
        frozen = Arm.parse(arm).frozen_layers
        probes += [
            peer_loop(arm, f"{name}, {frozen} frozen", make_peer(name, learn, frozen=frozen))
            for name in (SB3, TUNED_BF16)
        ]
        probes.append(our_loop(arm, f"ours, {arm}", arm))
    return probes


def vector_probes(_: str) -> list[Probe]:
    """Return the loop on numbers, with an update every 16 environment steps."""
    words = ("observation=vector", "learn.num_envs=64", "learn.batch_size=128", "learn.update_every=16")
    return [our_loop("", "ours, numbers", "scratch", *words)]


def update_probes(device: str) -> list[Probe]:
    """Return one update of each learner, on a batch that stays the same (Stable-Baselines3 draws its own).

    On a GPU they are of several sizes, and drawing the pictures is part of them.
    """
    probes = []
    if device != "cpu":
        for size in GPU_BATCHES:
            for kind, name in KINDS.items():
                ours = make_ours("scratch", f"device={device}", f"learn.batch_size={size}", kind)
                ours.fill(WARMUP_STEPS)
                run = partial(draw_and_learn, ours)
                probes.append(Probe(f"batch of {size}", name, run, UPDATES, "update", is_ours=True))
        return probes
    for name in PEERS:
        peer = make_peer(name, learn_config())
        update = peer.update if isinstance(peer, Sb3Loop) else partial(peer.update, peer.sample())
        probes.append(Probe("", name, update, unit="update"))
    for arm in ARMS:
        ours = make_ours(arm)
        ours.fill(WARMUP_STEPS)
        learn = partial(ours.algorithm.learn_from, ours.sample())
        probes.append(Probe("", f"ours, {arm}", learn, unit="update", is_ours=True))
    return probes


def draw_and_learn(ours: Ours) -> None:
    """Make `UPDATES` updates, each of a batch of its own."""
    for _ in range(UPDATES):
        ours.algorithm.learn_from(ours.sample())


def lockstep_probes(device: str) -> list[Probe]:
    """Return training loops of many agents; the steps of all agents count."""
    setting, found = SETTINGS["pixels"], []
    for count in AGENTS:
        length = setting.source_length
        tasks = [Task(CASE, "", "scratch", seed, length) for seed in range(count)]
        runs = [task.plan(setting.overrides, Path()) for task in tasks]
        agents, _ = make_lockstep(runs, starts(runs, [CASE] * count).to(device), setting.source_length)
        agents.train(runs[0].config.learn.warmup_steps + CAPTURE_STEPS)
        steps = AGENT_UPDATES * agents.learn.update_every
        run = partial(agents.train, steps)
        found.append(Probe(f"{count} agents", "ours", run, steps * count, is_ours=True))
    return found


PROBES: dict[str, Callable[[str], list[Probe]]] = {
    "loop": loop_probes,
    "update": update_probes,
    "frozen": frozen_probes,
    "vector": vector_probes,
    "lockstep": lockstep_probes,
}
