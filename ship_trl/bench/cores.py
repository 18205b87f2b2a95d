"""A grid's processes side by side: what a core more brings.

As a program, `python -m ship_trl.bench.cores SECONDS`, it is one of them: it trains behind its
warm-up, says so, waits for a line, trains for so long, and prints its steps a second.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack

from ship_trl.bench.footprint import surroundings

# Shorter, and the processes would hardly run at the same time.
LEAST_SECONDS = 3.0
READY = "ready"


def side_by_side(processes: int, seconds: float) -> float:
    """Return steps a second of so many trainings at once, all together."""
    command = [sys.executable, "-m", "ship_trl.bench.cores", str(seconds)]
    with ExitStack() as stack:
        started = []
        for _ in range(processes):
            process = stack.enter_context(
                subprocess.Popen(
                    command, env=surroundings(), text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
                )
            )
            # Runs before the process is waited for.
            stack.callback(process.kill)
            started.append(process)
        for process in started:
            assert process.stdout is not None
            if process.stdout.readline().strip() != READY:
                raise RuntimeError("a training of the benchmark did not start")
        for process in started:
            assert process.stdin is not None
            process.stdin.write("go\n")
            process.stdin.flush()
        said = [process.communicate()[0] for process in started]
        if not all(said):
            raise RuntimeError("a training of the benchmark ended early")
        return sum(map(float, said))


def growth_with_cores(rounds: int, seconds: float) -> dict[int, list[float]]:
    """Return steps a second by number of processes, 1 and one a core, in turn."""
    counts = sorted({1, cores()})
    rates: dict[int, list[float]] = {count: [] for count in counts}
    for _ in range(rounds):
        for count in counts:
            rates[count].append(side_by_side(count, seconds))
    return rates


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def gains(rates: dict[int, list[float]]) -> dict[int, float]:
    """Median over the rounds of how many times one process's steps so many make."""
    return {
        count: statistics.median(many / one for many, one in zip(found, rates[1], strict=True))
        for count, found in rates.items()
    }


def train_a_while(seconds: float) -> None:
    """Be one of the processes."""
    from ship_trl.bench.ours import Ours
    from ship_trl.run.process import configure_process

    configure_process()
    run = Ours().whole_loop()
    sys.stdout.write(f"{READY}\n")
    sys.stdout.flush()
    sys.stdin.readline()
    done, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        done += run()
    sys.stdout.write(str(done / (time.perf_counter() - start)))


if __name__ == "__main__":
    train_a_while(float(sys.argv[1]))
