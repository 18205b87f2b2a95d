"""A study's runs by arm and seed, and the kinds of claim that are measured on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.study.contrasts import Finding, contrast, found
from ship_trl.study.metrics import METRICS, time_to_threshold
from ship_trl.study.records import BrokenRunError, Record, find_runs, read_run
from ship_trl.study.statistics import (
    RESAMPLES,
    Estimate,
    Sample,
    bootstrap,
    brown_forsythe,
    interquartile_mean,
    log_rank,
    page_trend,
    steadiness,
)

# Of all resampling: the same study gives the same report.
SEED = 2022


@dataclass(frozen=True)
class Study:
    """The runs of a folder; `broken` are those that could not be read, with the reason.

    `resamples` is how often its seeds are drawn anew for an interval.
    """

    records: dict[tuple[str, str, str, int], Record]
    broken: list[tuple[Path, str]] = field(default_factory=list)
    resamples: int = RESAMPLES

    def arm(self, part: str, pair: str, arm: str) -> dict[int, Record]:
        """The runs of an arm by seed."""
        return {
            key[3]: record for key, record in sorted(self.records.items()) if key[:3] == (part, pair, arm)
        }

    def together(self, places: Mapping[str, tuple[str, str, str]]) -> dict[str, list[Record]]:
        """Runs by name, of the seeds that all of these (part, pair, arm) have, in order."""
        runs = {name: self.arm(*place) for name, place in places.items()}
        seeds = sorted(set.intersection(*(set(by_seed) for by_seed in runs.values())) if runs else set())
        return {name: [by_seed[seed] for seed in seeds] for name, by_seed in runs.items()}


def read_study(folder: Path) -> Study:
    """Read all runs below a folder; what cannot be read is named in `broken`."""
    study = Study({})
    for path, part in find_runs(folder):
        try:
            record = read_run(path, part)
        except BrokenRunError as error:
            study.broken.append((path, str(error)))
            continue
        # Where it lies is what it belongs to: a copied folder is not another seed.
        if path.parts[-3:] != (record.pair, record.arm, f"seed={record.seed}"):
            study.broken.append((path, "result.json is of another run"))
            continue
        study.records[part, record.pair, record.arm, record.seed] = record
    return study


Places = Mapping[str, tuple[str, str, str]]


def samples(study: Study, places: Places, measure: Callable[[Record], float]) -> dict[str, Sample]:
    """One number a seed for each name."""
    return {name: np.array([measure(r) for r in runs]) for name, runs in study.together(places).items()}


def enough(values: Mapping[str, Any]) -> bool:
    """Whether there are seeds to resample."""
    return bool(values) and min(len(v) for v in values.values()) >= 2


def levels(
    study: Study,
    claim: str,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    alike: bool = False,
) -> list[Finding]:
    """A weighted sum of levels is above zero, or with `alike` is zero; nothing where runs are missing."""
    found_samples = samples(study, places, METRICS[metric])
    if not enough(found_samples):
        return []
    return [contrast(claim, f"{what} ({metric})", found_samples, weights, SEED, alike, study.resamples)]


def steadier(study: Study, claim: str, places: Places, steady: str, other: str, metric: str) -> list[Finding]:
    """One arm varies less over seeds than the other: logarithm of the ratio of standard deviations."""
    values = samples(study, places, METRICS[metric])
    if not enough(values):
        return []
    estimate = steadiness(values[steady], values[other], SEED, study.resamples)
    p = brown_forsythe(values[steady], values[other])
    what = f"{steady} varies less than {other} ({metric}; log of the ratio of standard deviations)"
    return [found(claim, what, estimate, None, p, np.full(len(values[steady]), np.nan))]


def rises(study: Study, claim: str, places: Places, order: Iterable[str], metric: str) -> list[Finding]:
    """From arm to arm the level rises: the mean step between neighbours, and Page's test."""
    names = list(order)
    values = samples(study, places, METRICS[metric])
    if not enough(values):
        return []

    def step(*arms: Sample, axis: int) -> Any:
        return (interquartile_mean(arms[-1], axis) - interquartile_mean(arms[0], axis)) / (len(arms) - 1)

    ordered = [values[name] for name in names]
    estimate = bootstrap(ordered, step, SEED, study.resamples)
    # Two-sided: a fall contradicts.
    p = min(1.0, 2 * min(page_trend(ordered), page_trend(ordered[::-1])))
    what = f"{' < '.join(names)} ({metric}; mean step)"
    steps = (ordered[-1] - ordered[0]) / (len(ordered) - 1)
    return [found(claim, what, estimate, None, p, steps)]


def sooner(study: Study, claim: str, places: Places, early: str, late: str) -> list[Finding]:
    """One arm reaches the threshold earlier: share of episodes saved, and the log-rank test."""
    runs = study.together(places)
    if not enough(runs):
        return []
    times = {name: [time_to_threshold(r) for r in runs[name]] for name in (early, late)}
    length = len(runs[early][0].training.total)
    spent = {name: np.array([t for t, _ in found_times]) / length for name, found_times in times.items()}
    seen = {name: np.array([there for _, there in found_times]) for name, found_times in times.items()}
    difference = spent[late] - spent[early]
    if not (seen[early].any() or seen[late].any()):
        # Nobody got there: there is nothing to compare.
        what = f"{early} sooner than {late} (neither gets there)"
        return [found(claim, what, Estimate(0.0, -1.0, 1.0), None, 1.0, difference)]

    def saved(a: Sample, b: Sample, axis: int) -> Any:
        return np.mean(b, axis=axis) - np.mean(a, axis=axis)

    estimate = bootstrap((spent[early], spent[late]), saved, SEED, study.resamples)
    p = log_rank((spent[early], seen[early]), (spent[late], seen[late]))
    what = f"{early} sooner at the threshold than {late} (share of the episodes; censored at the end)"
    return [found(claim, what, estimate, None, p, difference)]
