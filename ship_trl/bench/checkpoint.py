"""`python -m ship_trl.bench.checkpoint`: what a checkpoint costs, in time and on the disk."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig
from torch import Generator

from ship_trl.bench.machine import processor_name
from ship_trl.cli.parser import make_parser
from ship_trl.config.checks import to_config
from ship_trl.config.paths import conf_dir
from ship_trl.learn.train import Training
from ship_trl.run.journal import Journal
from ship_trl.run.parts import Parts, make_parts
from ship_trl.run.plan import make_run
from ship_trl.run.process import configure_process
from ship_trl.run.run import Run
from ship_trl.run.source import read_source
from ship_trl.sim.env import ShipEnv

ARMS = ("scratch", "FE3-random", "FE4-random")
CPU = torch.device("cpu")


def main(arguments: list[str] | None = None) -> None:
    """Print a line for each arm."""
    parser = make_parser("ship_trl.bench.checkpoint", __doc__)
    parser.add_argument("--profile", choices=("quick", "paper"), default="paper")
    parser.add_argument("--repeats", type=int, default=10, help="checkpoints, each after some training")
    parser.add_argument("--stretch", type=float, default=2.0, help="seconds of a stretch")
    options = parser.parse_args(arguments)
    configure_process()
    say(f"{processor_name()}; profile {options.profile}, replay full; at most one a minute is written")
    say("arm          write   of a minute   both files   with a draft      read")
    for arm in ARMS:
        with tempfile.TemporaryDirectory() as folder:
            say(measure(arm, options.profile, options.repeats, options.stretch, Path(folder)))


def say(line: str) -> None:
    """One line."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def measure(arm: str, profile: str, repeats: int, stretch: float, folder: Path) -> str:
    """Train in stretches, write a checkpoint after each, and read the last one; returns the line."""
    run = planned(arm, profile, folder)
    run.folder.mkdir(parents=True)
    parts = make_parts(run, CPU, read_source(run))
    fill(parts, run)
    journal = Journal(run, parts, time.perf_counter())
    parts.history.add(parts.training.begin(), parts.agent.target_network)
    writes = []
    for _ in range(repeats):
        # In turn with training, whose numbers then lie in the processor's caches, not the checkpoint's.
        train(parts.training, stretch)
        started = time.perf_counter()
        journal.write()
        writes.append(time.perf_counter() - started)
    files = sorted(path.stat().st_size for path in journal.checkpoints.folder.iterdir())
    again = make_parts(run, CPU, read_source(run))
    started = time.perf_counter()
    Journal(run, again, started).resume()
    read, write = time.perf_counter() - started, statistics.median(writes)
    return (
        f"{arm:11s} {1e3 * write:4.0f} ms {write / 60:12.2%} {sum(files) / 1e6:9.1f} MB"
        f" {(sum(files) + files[-1]) / 1e6:11.1f} MB {read:7.1f} s"
    )


def planned(arm: str, profile: str, folder: Path) -> Run:
    """Plan a run of pair high that learns from its first steps on."""
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        line = [f"profile={profile}", "+pair=high", f"+arm={arm}", f"output={folder}"]
        quick = ["learn.warmup_steps=0", "learn.jumpstart_draws=0", "learn.episodes=1000000"]
        values = compose("config", line + quick)
    assert isinstance(values, DictConfig)
    return make_run(to_config(values))


def fill(parts: Parts, run: Run) -> None:
    """Fill the replay with steps of random actions."""
    agent, replay, learn = parts.agent, parts.training.replay, run.config.learn
    encoders = {agent.observation: agent.encode} if agent.observation != "state" else {}
    env = ShipEnv(run.target, run.config.world, learn.num_envs, encoders=encoders)
    current, generator = env.reset(), Generator().manual_seed(0)
    for _ in range(learn.replay_size // learn.num_envs):
        action = torch.randint(len(run.config.world.actions), (learn.num_envs,), generator=generator)
        stepped, current = env.step_and_maybe_reset(current.set("action", action))
        replay.extend(stepped)


def train(training: Training, stretch: float) -> None:
    """Train for so many seconds at least."""
    started = time.perf_counter()
    while time.perf_counter() - started < stretch:
        for _ in training.advance():
            pass


if __name__ == "__main__":
    main()
