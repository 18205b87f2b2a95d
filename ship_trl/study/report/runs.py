"""Tables of any runs, a row for each group: the usual metrics of transfer, and how steadily runs learn."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ship_trl.files.record import RunRecord
from ship_trl.study.metrics import METRICS, THRESHOLDS, measure
from ship_trl.study.records.record import read_groups
from ship_trl.study.report.tables import FORWARD, Row, arm_rows
from ship_trl.study.statistics import Estimate
from ship_trl.study.study import Study

# `start` is the jumpstart of a transfer less that of scratch; `total time` counts the source's episodes.
TRANSFER = (
    *("start", "early area", "area", "greedy area", "time", "asymptote", "success", "forgetting"),
    *("total time", FORWARD),
)
TRANSFER_HEADINGS = ("run", "seeds", *TRANSFER)
BEST, LAST = "best of known", "last of known"
# `fell` and `misses` are metrics.
STABILITY_HEADINGS = (
    *("run", "runs", "fell", "misses", "area", "asymptote", f"time to {THRESHOLDS[0]}"),
    *(BEST, LAST, "last near best"),
)
# The last network is near the best one if it loses at most this share of its return.
NEAR_BEST = 0.1


def transfer_rows(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[list[str]]:
    """Yield a row of transfer metrics for each group of runs; its name holds pair, arm and settings.

    An arm is compared with runs from scratch of the same settings.
    """
    records, names = {}, {}
    for name, record in read_groups(groups):
        arm = record.arm
        # "low FT3 learn.lr=0.01"; the name of a folder may hold blanks too.
        pair = re.sub(rf" {re.escape(arm)}(?= \S+=|$)", "", name, count=1)
        records["", pair, arm, record.seed] = record
        names[pair, arm] = name
    for row in arm_rows(Study(records)):
        cells = (describe(row, name) for name in TRANSFER)
        yield [names[row["pair"], row["arm"]], str(row["seeds"]), *cells]


def describe(row: Row, name: str) -> str:
    """Format a metric with its interval, if there is one; - where it was not measured."""
    value, low, high = (row.get(key, "") for key in (name, f"{name} low", f"{name} high"))
    return "-" if value == "" else Estimate(value, low, high).words()


def describe_scales(runs: Iterable[RunRecord]) -> str:
    """Return a line for each target that says what scores of 0 and 1 are, and one on areas."""
    lines = {
        f"scores on {one.target}: 0 is a return of {one.random_return:g}, 1 is {one.best_known_return:g}\n"
        for one in runs
        if one.best_known_return is not None
    }
    return "".join(sorted(lines)) + "areas over training episodes; forward transfer: paired by seed\n"


def measure_runs(groups: Mapping[str, Sequence[RunRecord]]) -> Iterator[dict[str, Any]]:
    """Yield every metric of every run, and its best and last greedy return as shares of the best known.

    A run that cannot be read is named on stderr and left out.
    """
    for name, record in read_groups(groups):
        metrics = {metric: measure(record, metric) for metric in METRICS}
        returns, known = record.greedy.returns, record.best_known
        shares = {BEST: float(np.max(returns)) / known, LAST: float(returns[-1]) / known}
        yield {"run": name, "seed": record.seed, **metrics, **shares}


def stability_rows(measured: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """Yield a table row for each group of measured runs: means over runs, with the deviation over seeds."""
    for name in dict.fromkeys(run["run"] for run in measured):
        runs = [run for run in measured if run["run"] == name]
        near = [run[LAST] >= run[BEST] - NEAR_BEST * abs(run[BEST]) for run in runs]
        yield [
            name,
            str(len(runs)),
            f"{sum(run['fell'] for run in runs):.0f}",
            f"{np.mean([run['misses'] for run in runs]):.3f}",
            *(spread([run[metric] for run in runs]) for metric in ("area", "asymptote", "time", BEST)),
            f"{np.median([run[LAST] for run in runs]):.3f} (median)",
            f"{sum(near)} of {len(near)}",
        ]


def spread(values: Sequence[float]) -> str:
    """Format a mean with the standard deviation over seeds."""
    deviation = f" ± {np.std(values, ddof=1):.3f}" if len(values) > 1 else ""
    return f"{np.mean(values):.3f}{deviation}"
