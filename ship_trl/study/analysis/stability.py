"""How steadily runs learn: falls after exploration, and the spread over seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.config.errors import print_error
from ship_trl.study.analysis.metrics import METRICS, THRESHOLDS, measure
from ship_trl.study.records.record import BrokenRunError, Record, read_run

HEADINGS = (
    "run",
    "runs",
    "fell",
    "misses",
    "area",
    "asymptote",
    f"time to {THRESHOLDS[0]}",
    "best of known",
    "last of known",
    "last near best",
)
# The last network is near the best one if it loses at most this share of its return.
NEAR_BEST = 0.1


def rows(groups: Mapping[str, Sequence[Path]]) -> Iterator[list[str]]:
    """Yield a row for each group of runs: means over runs with the standard deviation over seeds.

    fell: runs that missed the goal ten times in a row after exploration; misses: share of the episodes after
    exploration that do; best and last greedy return as a share of the best known; last near best: runs whose
    last network loses at most a tenth of the best one's return.
    """
    for name, folders in groups.items():
        records = [record for record in map(read, folders) if record is not None]
        if not records:
            continue
        best, last = (np.array(shares) for shares in zip(*map(shares_of_known, records), strict=True))
        near = last >= best - NEAR_BEST * np.abs(best)
        yield [
            name,
            str(len(records)),
            f"{sum(measure(r, 'fell') for r in records):.0f}",
            f"{np.mean([measure(r, 'misses') for r in records]):.3f}",
            *(spread([measure(r, metric) for r in records]) for metric in ("area", "asymptote", "time")),
            spread(best),
            f"{np.median(last):.3f} (median)",
            f"{near.sum()} of {len(near)}",
        ]


def numbers(groups: Mapping[str, Sequence[Path]]) -> Iterator[dict[str, Any]]:
    """Yield every number of every run, with the name of its group and its seed."""
    for name, folders in groups.items():
        for record in filter(None, map(read, folders)):
            best, last = shares_of_known(record)
            metrics = {metric: measure(record, metric) for metric in METRICS}
            yield {"run": name, "seed": record.seed, **metrics, "best of known": best, "last of known": last}


def shares_of_known(record: Record) -> tuple[float, float]:
    """Return the best and the last greedy return as shares of the best known return."""
    returns = record.greedy.returns
    return float(np.max(returns)) / record.best_known, float(returns[-1]) / record.best_known


def spread(values: Any) -> str:
    """Format a mean with the standard deviation over seeds."""
    deviation = f" ± {np.std(values, ddof=1):.3f}" if len(values) > 1 else ""
    return f"{np.mean(values):.3f}{deviation}"


def read(folder: Path) -> Record | None:
    """Read a run; None, with a message, if it is not whole."""
    try:
        return read_run(folder)
    except BrokenRunError as error:
        print_error(f"{folder}: {error}; left out")
        return None
