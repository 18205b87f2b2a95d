"""What a checkpoint costs: seconds to write and to read, and bytes on the disk."""

from __future__ import annotations

import tempfile
import time

from benchmarks.ours import Ours
from benchmarks.timing import Measurement
from benchmarks.work import plan_run
from ship_trl.run.journal import Journal

ARMS = ("scratch", "FE3", "FE4")


def measure_checkpoints(rounds: int, seconds: float, *overrides: str) -> list[Measurement]:
    """Measure checkpoints of a run with a full replay, for every arm.

    Args:
        rounds: how many checkpoints are written.
        seconds: how long the run trains before each of them.
        overrides: of the paper's profile.
    """
    found = []
    for arm in ARMS:
        with tempfile.TemporaryDirectory() as folder:
            no_wait = ("learn.warmup_steps=0", f"output={folder}")
            found += measure_arm(arm, Ours(plan_run(arm, no_wait + overrides)), rounds, seconds)
    # A group compares the arms in one quantity.
    return sorted(found, key=lambda one: (one.unit != "s", one.group != "write"))


def measure_arm(arm: str, ours: Ours, rounds: int, seconds: float) -> list[Measurement]:
    """Train and write a checkpoint in turns, then read the last one."""
    ours.fill(ours.learn.replay_size)
    ours.run.folder.mkdir(parents=True)
    journal = Journal(ours.run, ours.parts, time.perf_counter())
    ours.parts.history.add(ours.training.begin(), ours.algorithm.network)
    writes = []
    for _ in range(rounds):
        # As in a run, the processor's caches then hold the training's numbers, not the checkpoint's.
        start = time.perf_counter()
        while time.perf_counter() - start < seconds:
            ours.train(1)
        start = time.perf_counter()
        journal.write()
        writes.append(time.perf_counter() - start)
    sizes = [float(path.stat().st_size) for path in journal.checkpoints.folder.iterdir()]
    again = Ours(ours.run)
    start = time.perf_counter()
    Journal(ours.run, again.parts, start).resume()
    read = time.perf_counter() - start
    return [
        Measurement("write", arm, "s", writes),
        Measurement("read", arm, "s", [read]),
        Measurement(f"{len(sizes)} on the disk", arm, "byte", [sum(sizes)]),
    ]
