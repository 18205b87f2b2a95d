"""How steadily runs learn: whether they fall back after exploration, and how they spread over seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.study.analysis.metrics import METRICS, THRESHOLDS, measure
from ship_trl.study.records.record import read_groups

BEST, LAST = "best of known", "last of known"
# Columns of the table; `fell` and `misses` are metrics.
HEADINGS = (
    *("run", "runs", "fell", "misses", "area", "asymptote", f"time to {THRESHOLDS[0]}"),
    *(BEST, LAST, "last near best"),
)
# The last network is near the best one if it loses at most this share of its return.
NEAR_BEST = 0.1


def measure_runs(groups: Mapping[str, Sequence[Path]]) -> Iterator[dict[str, Any]]:
    """Yield every metric of every run, and its best and last greedy return as shares of the best known.

    A run that cannot be read is named on stderr and left out.
    """
    for name, record in read_groups(groups):
        metrics = {metric: measure(record, metric) for metric in METRICS}
        returns, known = record.greedy.returns, record.best_known
        shares = {BEST: float(np.max(returns)) / known, LAST: float(returns[-1]) / known}
        yield {"run": name, "seed": record.result.seed, **metrics, **shares}


def rows(measured: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
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
