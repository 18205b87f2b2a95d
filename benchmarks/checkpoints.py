"""What a checkpoint costs: seconds to write and to read, and bytes on the disk."""

from __future__ import annotations

import tempfile
import time

import torch
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

from benchmarks.ours import fill_replay, train_steps, training_env
from benchmarks.timing import Measurement
from ship_trl.config.checks import to_config
from ship_trl.config.paths import conf_dir
from ship_trl.run.journal import Journal
from ship_trl.run.parts import make_parts
from ship_trl.run.plan import Run, make_run

ARMS = ("scratch", "FE3-random", "FE4-random")
CPU = torch.device("cpu")


def measure_checkpoints(rounds: int, seconds: float, profile: str = "paper") -> list[Measurement]:
    """Measure checkpoints of a run with a full replay, for every arm.

    Args:
        rounds: how many checkpoints are written.
        seconds: how long the run trains before each of them.
        profile: of the run.
    """
    found = []
    for arm in ARMS:
        with tempfile.TemporaryDirectory() as folder:
            found += measure_arm(arm, plan(arm, profile, folder), rounds, seconds)
    return found


def plan(arm: str, profile: str, folder: str) -> Run:
    """Plan a run of pair high that learns from its first step."""
    overrides = [f"profile={profile}", "+pair=high", f"+arm={arm}", f"output={folder}"]
    no_wait = ["learn.warmup_steps=0", "learn.jumpstart_draws=0", "learn.episodes=1000000"]
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        values = compose("config", overrides + no_wait)
    assert isinstance(values, DictConfig)
    return make_run(to_config(values))


def measure_arm(arm: str, run: Run, rounds: int, seconds: float) -> list[Measurement]:
    """Train and write a checkpoint in turns, then read the last one."""
    run.folder.mkdir(parents=True)
    parts, learn = make_parts(run, CPU, None), run.config.learn
    training, env = parts.training, training_env(parts.agent, run.target, run.config.world, learn)
    fill_replay(training.replay, env, learn.replay_size)
    journal = Journal(run, parts, time.perf_counter())
    parts.history.add(training.begin(), parts.agent.target_network)
    writes = []
    for _ in range(rounds):
        # As in a run, what the processor has in its caches is then the training's, not the checkpoint's.
        start = time.perf_counter()
        while time.perf_counter() - start < seconds:
            train_steps(training, 1)
        start = time.perf_counter()
        journal.write()
        writes.append(time.perf_counter() - start)
    sizes = [float(path.stat().st_size) for path in journal.checkpoints.folder.iterdir()]
    again = make_parts(run, CPU, None)
    start = time.perf_counter()
    Journal(run, again, start).go_on()
    read = time.perf_counter() - start
    return [
        Measurement(arm, "write", "s", writes),
        Measurement(arm, "read", "s", [read]),
        Measurement(arm, f"{len(sizes)} on the disk", "byte", [sum(sizes)]),
    ]
