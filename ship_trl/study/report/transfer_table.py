"""The usual metrics of transfer of any runs, a row for each arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path

from ship_trl.study.analysis.study import Study
from ship_trl.study.records.record import read_groups
from ship_trl.study.report.tables import FORWARD, Row, arm_rows

# `start` is the jumpstart of a transfer less that of scratch; `total time` counts the source's episodes.
METRICS = (
    *("start", "early area", "area", "greedy area", "time", "asymptote", "success", "forgetting"),
    *("total time", FORWARD),
)
HEADINGS = ("run", "seeds", *METRICS)


def rows(groups: Mapping[str, Sequence[Path]]) -> Iterator[list[str]]:
    """Yield a table row for each group of run folders that has the same pair and arm."""
    records = {
        ("", name.removesuffix(f" {record.arm.name}"), record.arm.name, record.seed): record
        for name, record in read_groups(groups)
    }
    for row in arm_rows(Study(records)):
        cells = (describe(row, name) for name in METRICS)
        yield [f"{row['pair']} {row['arm']}", str(row["seeds"]), *cells]


def describe(row: Row, name: str) -> str:
    """Format a metric with its interval, if there is one; - where it was not measured."""
    value, low, high = (row.get(key, "") for key in (name, f"{name} low", f"{name} high"))
    if value == "":
        return "-"
    return f"{value:.2f} ({low:.2f} to {high:.2f})" if isfinite(low) else f"{value:.2f}"
