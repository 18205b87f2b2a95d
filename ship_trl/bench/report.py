"""Tables for people, as rich or as Markdown, and JSON lines for programs."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from ship_trl.bench.machine import Machine
from ship_trl.bench.timing import Timing

console = Console(highlight=False)
COLUMNS = ("group", "name", "unit", "per s", "spread", "of peer", "ours is", "of peak")
LEFT = {"group", "name", "unit"}


def number(value: float) -> str:
    """Three digits that count, with k and M."""
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:.3g}{letter}" if value < 999.5 * size else f"{value / size:.0f}{letter}"
    return f"{value:.3g}"


def ratio(value: float | None) -> str:
    """How many times, or nothing."""
    return "" if value is None else f"{value:.2f}x" if value < 99.5 else f"{value:.0f}x"


@dataclasses.dataclass(frozen=True)
class Row:
    """A line of a table: a probe's rates against its group's.

    `of_peer` is its rate over that of the group's first peer, `ours_is` the rate of the group's
    first of ours over a peer's, `of_peak` its operations over the processor's peak.
    """

    part: str
    group: str
    name: str
    unit: str
    ours: bool
    median: float
    low: float
    high: float
    rates: list[float]
    of_peer: float | None
    ours_is: float | None
    of_peak: float | None
    precision: str | None

    def cells(self) -> list[str]:
        """Its text, by `COLUMNS`."""
        share = "" if self.of_peak is None else f"{self.of_peak:.0%} {self.precision}"
        spread = f"{number(self.low)}..{number(self.high)}"
        ratios = [ratio(self.of_peer), ratio(self.ours_is)]
        return [self.group, self.name, self.unit, number(self.median), spread, *ratios, share]


def rows(part: str, timings: Sequence[Timing], machine: Machine) -> list[Row]:
    """Compare timings within their groups."""
    found = []
    for timing in timings:
        probe = timing.probe
        group = [other for other in timings if other.probe.group == probe.group]
        peer = next((other.rate for other in group if not other.probe.ours), None)
        ours = next((other.rate for other in group if other.probe.ours), None)
        counted = probe.flops is not None
        found.append(
            Row(
                part=part,
                group=probe.group,
                name=probe.name,
                unit=probe.unit,
                ours=probe.ours,
                median=timing.rate,
                low=timing.low,
                high=timing.high,
                rates=timing.rates,
                of_peer=timing.rate / peer if peer else None,
                ours_is=ours / timing.rate if ours and not probe.ours else None,
                of_peak=timing.rate * (probe.flops or 0) / machine.peak(probe.precision) if counted else None,
                precision=probe.precision if counted else None,
            )
        )
    return found


def show(title: str, columns: Sequence[str], lines: Sequence[Sequence[str]], markdown: bool) -> None:
    """Print a table; columns that are empty throughout are left out."""
    kept = [k for k in range(len(columns)) if any(line[k] for line in lines)]
    if markdown:
        say(f"\n{title}\n")
        say("| " + " | ".join(columns[k] for k in kept) + " |")
        say("| " + " | ".join("---" if columns[k] in LEFT else "---:" for k in kept) + " |")
        for line in lines:
            say("| " + " | ".join(line[k] for k in kept) + " |")
        return
    table = Table(title=title, title_justify="left")
    for k in kept:
        table.add_column(columns[k], justify="left" if columns[k] in LEFT else "right")
    before = None
    for line in lines:
        if before is not None and line[0] != before:
            table.add_section()
        # A group is named once.
        table.add_row(*(("" if k == 0 and line[0] == before else line[k]) for k in kept))
        before = line[0]
    console.print(table)


def say(text: str) -> None:
    """One line."""
    console.print(text, markup=False, soft_wrap=True)


def header(machine: Machine) -> None:
    """Processor and peaks."""
    threads = "thread" if machine.threads == 1 else "threads"
    cores = "core" if machine.cores == 1 else "cores"
    say(f"{machine.processor}, {machine.cores} {cores}, torch {machine.torch}, {machine.threads} {threads}")
    say(
        f"Peaks measured now: {machine.fp32:.0f} GFLOP/s fp32, {machine.bf16:.0f} GFLOP/s bf16, "
        f"copying {machine.copy:.1f} GB/s"
    )


def json_line(values: Any) -> str:
    """Write an object, or a dataclass, as one line."""
    plain = dataclasses.asdict(values) if dataclasses.is_dataclass(values) else values  # type: ignore[arg-type]
    return json.dumps(plain)
