"""Time probes in turn, so that whatever else the machine does slows all of them alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Probe:
    """A piece of work to time: `run` does `count` times what `unit` names.

    Probes of one `group` are compared with each other; the first one is the baseline.
    """

    group: str
    name: str
    run: Callable[[], object]
    count: int = 1
    unit: str = "step"
    is_ours: bool = False


@dataclass(frozen=True)
class Measurement:
    """What was measured, one value a round: a rate in units a second, or a size."""

    group: str
    name: str
    unit: str
    values: list[float]
    is_ours: bool = False

    @property
    def median(self) -> float:
        """The median of the rounds."""
        return statistics.median(self.values)


def measure(
    probes: Sequence[Probe], rounds: int, seconds: float, finish: Callable[[], object] = lambda: None
) -> list[Measurement]:
    """Return the rate of every probe in every round, in the order of the probes.

    Each probe runs once untimed. Then, in each round, the probes take turns: each runs until `seconds`
    have passed, at least once. `finish` waits for what a probe has begun elsewhere, as on a GPU.
    """
    rates: list[list[float]] = [[] for _ in probes]
    for probe in probes:
        probe.run()
    for _ in range(rounds):
        for probe, found in zip(probes, rates, strict=True):
            done, elapsed, start = 0, 0.0, time.perf_counter()
            while done == 0 or elapsed < seconds:
                probe.run()
                finish()
                done, elapsed = done + probe.count, time.perf_counter() - start
            found.append(done / elapsed)
    return [
        Measurement(probe.group, probe.name, f"{probe.unit}/s", found, probe.is_ours)
        for probe, found in zip(probes, rates, strict=True)
    ]
