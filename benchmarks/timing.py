"""Time probes in turn, so that whatever else the machine does slows all of them alike, and print tables."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ship_trl.run.console import show


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


def print_table(title: str, measured: Sequence[Measurement], markdown: bool) -> None:
    """Print a row for each measurement, without the columns that are empty.

    `of first` is its value over that of the first of its group, `ours is` the value of the group's first one
    of ship_trl over this peer's. Both are medians of the ratios of the rounds.
    """
    headings, rows = ("group", "name", "unit", "median", "range", "of first", "ours is"), []
    for one in measured:
        group = [other for other in measured if (other.group, other.unit) == (one.group, one.unit)]
        ours = next((other for other in group if other.is_ours), None)
        spread = f"{short(min(one.values))}..{short(max(one.values))}" if len(one.values) > 1 else ""
        of_first = "" if one is group[0] else f"{ratio(one, group[0]):.2f}x"
        ours_is = f"{ratio(ours, one):.2f}x" if ours is not None and not one.is_ours else ""
        median = short(statistics.median(one.values))
        rows.append([one.group, one.name, one.unit, median, spread, of_first, ours_is])
    kept = [name for k, name in enumerate(headings) if any(row[k] for row in rows)]
    show(headings, rows, markdown, title, kept)


def ratio(above: Measurement, below: Measurement) -> float:
    """Return the median over the rounds of one measurement's value over another's."""
    return statistics.median(a / b for a, b in zip(above.values, below.values, strict=True))


def short(value: float) -> str:
    """Return a number with three significant digits, and k, M or G."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:.3g}{letter}" if value < 999.5 * size else f"{value / size:.0f}{letter}"
    return f"{value:.3g}"
