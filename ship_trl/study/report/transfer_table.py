"""The usual metrics of transfer of any runs, a row for each arm."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from ship_trl.files.result import Result
from ship_trl.study.analysis.statistics import Estimate
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
    """Yield a table row for each group of run folders; its name holds pair, arm and settings.

    An arm is compared with runs from scratch of the same settings.
    """
    records, names = {}, {}
    for name, record in read_groups(groups):
        arm = record.arm.name
        # "low FT3 learn.lr=0.01"; the name of a folder may hold blanks too.
        pair = re.sub(rf" {re.escape(arm)}(?= \S+=|$)", "", name, count=1)
        records["", pair, arm, record.result.seed] = record
        names[pair, arm] = name
    for row in arm_rows(Study(records)):
        cells = (describe(row, name) for name in METRICS)
        yield [names[row["pair"], row["arm"]], str(row["seeds"]), *cells]


def describe(row: Row, name: str) -> str:
    """Format a metric with its interval, if there is one; - where it was not measured."""
    value, low, high = (row.get(key, "") for key in (name, f"{name} low", f"{name} high"))
    return "-" if value == "" else Estimate(value, low, high).words()


def describe_scales(results: Iterable[Result]) -> str:
    """Return a line for each target that says what scores of 0 and 1 are, and one on areas."""
    lines = {
        f"scores on {one.target}: 0 is a return of {one.random_return:g}, 1 is {one.best_known_return:g}\n"
        for one in results
        if one.best_known_return is not None
    }
    return "".join(sorted(lines)) + "areas over training episodes; forward transfer: paired by seed\n"
