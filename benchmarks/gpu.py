"""`python -m benchmarks gpu`: speed of simulation, updates and training loops on a GPU.

Rows named "operation by operation" do the same work without CUDA graphs (`fast=false`). Training loops, and
Stable-Baselines3's for comparison, are those of
`python -m benchmarks loop`: case 4, batches of 32, an update every 4 steps. Both sides run with one CPU
thread and deterministic cuDNN.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from benchmarks.work import CASE, STEPS_PER_CALL, WARMUP_STEPS, learn_config, require_peers
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive, PositiveShare
from ship_trl.config.errors import ConfigError

if TYPE_CHECKING:
    from benchmarks.timing import Measurement, Probe

BATCHES, UPDATE_BATCHES = (1, 64, 4096, 65536), (32, 256, 2048)
KINDS = {"fast=true": "ours", "fast=false": "ours, operation by operation"}
# Steps, updates in one call of a probe.
STEPS, UPDATES = 16, 8
# Agents in lockstep, also on a CPU, and environment steps that they take for their graphs to be captured.
AGENTS, FEW_AGENTS, CAPTURE_STEPS = (1, 20, 80, 320), (1, 4), 50
LARGE = "learn.num_envs=64", "learn.batch_size=512", "learn.update_every=64"
TITLES = {
    "simulator": "Simulation and drawing of 84x84 pixels",
    "update": "One gradient step",
    "loop": "Training loop",
    "lockstep": "Training loops of many agents, batches of 32, an update every 3 steps",
}


def simulator_probes(device: str) -> list[Probe]:
    """Return steps of environments that draw, by their number."""
    import torch

    from benchmarks.timing import Probe
    from ship_trl.fast.worlds import make_env
    from ship_trl.sim.cases import load_case, load_world
    from ship_trl.sim.env import ShipEnv

    world, found = load_world(), []
    for count in BATCHES:
        for kind, name in KINDS.items():
            env = make_env(
                load_case(CASE, world),
                world,
                count,
                from_pixels=True,
                device=device,
                fast=kind == "fast=true",
            )
            action = torch.randint(len(world.actions), (count,)).to(device)

            def run(env: ShipEnv = env, action: torch.Tensor = action) -> None:
                current = env.reset()
                for _ in range(STEPS):
                    _, current = env.step_and_maybe_reset(current.set("action", action))

            found.append(Probe(f"{count} ships", name, run, STEPS * count, is_ours=True))
    return found


def update_probes(device: str) -> list[Probe]:
    """Return gradient steps on batches of several sizes; drawing the pictures is part of them."""
    from benchmarks.ours import make_ours
    from benchmarks.timing import Probe

    found = []
    for size in UPDATE_BATCHES:
        for kind, name in KINDS.items():
            ours = make_ours("scratch", f"device={device}", f"learn.batch_size={size}", kind)
            ours.fill(WARMUP_STEPS)

            def run(ours: object = ours) -> None:
                for _ in range(UPDATES):
                    ours.algorithm.learn_from(ours.sample())  # type: ignore[attr-defined]

            found.append(Probe(f"batch of {size}", name, run, UPDATES, "update", is_ours=True))
    return found


def lockstep_probes(device: str) -> list[Probe]:
    """Return training loops of many agents; the steps of all agents count."""
    from pathlib import Path

    from benchmarks.timing import Probe
    from studies.lockstep import make_lockstep, starts
    from studies.runs import Task
    from studies.sources.plan import SETTINGS

    setting, found = SETTINGS["pixels"], []
    for count in FEW_AGENTS if device == "cpu" else AGENTS:
        runs = [Task(CASE, "", "scratch", seed, True).plan(setting, Path()) for seed in range(count)]
        agents, _ = make_lockstep(runs, starts(runs, [CASE] * count).to(device), setting.source_length)
        agents.train(runs[0].config.learn.warmup_steps + CAPTURE_STEPS)
        steps = STEPS * agents.learn.update_every
        found.append(
            Probe(f"{count} agents", "ours", partial(agents.train, steps), steps * count, is_ours=True)
        )
    return found


def loop_probes(device: str) -> list[Probe]:
    """Return whole training loops, and Stable-Baselines3's."""
    from benchmarks.ours import make_ours, start_loop
    from benchmarks.peer_sb3 import Sb3Loop
    from benchmarks.timing import Probe
    from ship_trl.gym import ShipCollisionEnv

    learn = learn_config()
    peer = Sb3Loop(ShipCollisionEnv(CASE, reward_scale=learn.reward_scale), learn, device=device)
    peer.run(WARMUP_STEPS)
    found = [Probe("", "SB3 DQN as it is", partial(peer.run, STEPS_PER_CALL), STEPS_PER_CALL)]
    for name, arm, *words in (
        ("ours", "scratch"),
        ("ours, operation by operation", "scratch", "fast=false"),
        ("ours, FE3", "FE3"),
        ("ours, 64 environments, an update every 4 steps", "scratch", "learn.num_envs=64"),
        ("ours, 64 environments, batches of 512 every 64", "scratch", *LARGE),
    ):
        run = start_loop(make_ours(arm, f"device={device}", *words))
        found.append(Probe("", name, run, STEPS_PER_CALL, is_ours=True))
    return found


PROBES: dict[str, Callable[[str], list[Probe]]] = {
    "simulator": simulator_probes,
    "update": update_probes,
    "loop": loop_probes,
    "lockstep": lockstep_probes,
}


def main(words: list[str]) -> None:
    """Measure, and print a table for each part."""
    parser = make_parser("benchmarks", __doc__ or "")
    parser.prog = "python -m benchmarks gpu"
    parser.add_argument("--device", default="cuda", help="default cuda")
    add_number(parser, "--rounds", Positive, 3, "passes over the probes of a part (default 3)")
    add_number(parser, "--seconds", PositiveShare, 1.0, "for a probe in a round, at most 1 (default 1)")
    parser.add_argument("--only", choices=tuple(PROBES), action="append", help="a part; default: all")
    options = parser.parse_args(words)
    with refusals():
        require_peers()
        import torch

        if options.device != "cpu" and not torch.cuda.is_available():
            raise ConfigError("--device: no CUDA device is available here; allowed: cpu")
        measure_parts(options.device, options.only or list(PROBES), options.rounds, options.seconds)


def measure_parts(device: str, parts: list[str], rounds: int, seconds: float) -> None:
    """Measure the parts on a device and print their tables."""
    import torch
    from rich.console import Console

    from benchmarks.table import compare, print_table
    from benchmarks.timing import measure
    from ship_trl.run.process import configure_process, processor_name

    configure_process()
    is_gpu = device != "cpu"
    finish = torch.cuda.synchronize if is_gpu else lambda: None
    name = torch.cuda.get_device_name() if is_gpu else processor_name()
    say = Console(highlight=False).print
    say(f"{name}, torch {torch.__version__}")
    for part in parts:
        found: list[Measurement] = measure(PROBES[part](device), rounds, seconds, finish)
        print_table(TITLES[part], compare(part, found), markdown=True)
        if is_gpu:
            say(f"at most {torch.cuda.max_memory_allocated() / 2**30:.2f} GiB of GPU memory")
            torch.cuda.reset_peak_memory_stats()
