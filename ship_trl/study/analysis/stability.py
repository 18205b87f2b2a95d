"""How steadily runs learn: which fall back after exploration, and how they spread over seeds."""

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
# The last network is near the best one if it loses no more of its return.
NEAR = 0.1


def rows(groups: Mapping[str, Sequence[Path]]) -> Iterator[list[str]]:
    """Yield a row for each group of runs: numbers are means over runs, with the deviation over seeds.

    fell: runs that, exploration over, missed the goal ten times in a row; misses: share of the episodes
    after exploration that do; best and last greedy return as a share of the best known; how many of the
    last networks lose at most a tenth of the best one's return.
    """
    for name, folders in groups.items():
        records = [record for record in map(read, folders) if record is not None]
        if not records:
            continue
        best, last = (
            np.array([pick(r.greedy.returns) / r.best_known for r in records]) for pick in (np.max, final)
        )
        near = last >= best - NEAR * np.abs(best)
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
    """Yield every number of every run, by the name of its group and its seed."""
    for name, folders in groups.items():
        for record in filter(None, map(read, folders)):
            row: dict[str, Any] = {"run": name, "seed": record.seed}
            row |= {metric: measure(record, metric) for metric in METRICS}
            row |= {
                "best of known": np.max(record.greedy.returns) / record.best_known,
                "last of known": final(record.greedy.returns) / record.best_known,
            }
            yield row


def final(returns: Any) -> float:
    """Return the last of some returns."""
    return float(returns[-1])


def spread(values: Any) -> str:
    """Write a mean with the standard deviation over seeds."""
    deviation = f" ± {np.std(values, ddof=1):.3f}" if len(values) > 1 else ""
    return f"{np.mean(values):.3f}{deviation}"


def read(folder: Path) -> Record | None:
    """Read a run; says so where its curve is not whole."""
    try:
        return read_run(folder)
    except BrokenRunError as error:
        print_error(f"{folder}: {error}; left out")
        return None
