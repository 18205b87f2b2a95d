"""Interleaved timing: whatever else the machine does meanwhile falls on all probes alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Probe:
    """Something to be timed.

    Args:
        name: its row in the table.
        run: does a bounded amount of work and returns how many units it did.
        unit: what is counted.
        group: rows that are compared with each other.
        ours: ours, or a peer's.
        flops: floating point operations of one unit, where they are counted.
        precision: `fp32` or `bf16`, the peak they are held against.
    """

    name: str
    run: Callable[[], int]
    unit: str = "step"
    group: str = ""
    ours: bool = False
    flops: float | None = None
    precision: str = "fp32"


@dataclass
class Timing:
    """A probe's rates, in units a second, one of each round."""

    probe: Probe
    rates: list[float] = field(default_factory=list)

    @property
    def rate(self) -> float:
        """The median of the rounds."""
        return statistics.median(self.rates)

    @property
    def low(self) -> float:
        """The slowest round."""
        return min(self.rates)

    @property
    def high(self) -> float:
        """The fastest round."""
        return max(self.rates)


def measure(
    probes: Sequence[Probe],
    rounds: int,
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Timing]:
    """Time all probes in turn, `rounds` times over.

    Each probe runs once beforehand, uncounted, and then in each round until `seconds` have passed,
    at least once.

    Args:
        probes: what to time; the result is in the same order.
        rounds: passes over all of them.
        seconds: for one probe in one round.
        clock: seconds from any start.
    """
    timings = [Timing(probe) for probe in probes]
    for probe in probes:
        probe.run()
    for _ in range(rounds):
        for timing in timings:
            done, started = 0, clock()
            while True:
                done += timing.probe.run()
                passed = clock() - started
                if passed >= seconds:
                    break
            timing.rates.append(done / passed)
    return timings
