"""A study's runs by arm and seed, and the kinds of claim that are measured on them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ship_trl.study.contrasts import LEVEL, Claimed, Finding, contrast, found
from ship_trl.study.metrics import METRICS, time_to_threshold
from ship_trl.study.plan import PAIRS, PARTS
from ship_trl.study.records import BrokenRunError, Record, find_runs, read_placed
from ship_trl.study.statistics import (
    RESAMPLES,
    Estimate,
    Sample,
    bootstrap,
    brown_forsythe,
    interquartile_mean,
    log_rank,
    page_trend,
    permutation,
    slope,
    steadiness,
    unmeasured,
)

# Of all resampling: the same study gives the same report.
SEED = 2022


Records = dict[tuple[str, str, str, int], Record]


@dataclass(frozen=True)
class Study:
    """The runs of a folder; `broken` are those that could not be read, with the reason.

    `resamples` is how often its seeds are drawn anew for an interval; a `rough` one leaves out those
    on which no verdict of a difference can hang.
    """

    records: Records
    broken: list[tuple[Path, str]] = field(default_factory=list)
    resamples: int = RESAMPLES
    rough: bool = False

    def interval(self, values: Sequence[Sample], statistic: Callable[..., Any], p: float) -> Estimate:
        """A statistic over seeds with its interval, for a contrast of this p."""
        if self.rough and p > LEVEL:
            return unmeasured(values, statistic)
        return bootstrap(values, statistic, SEED, self.resamples)

    def arm(self, part: str, pair: str, arm: str) -> dict[int, Record]:
        """The runs of an arm by seed."""
        return {
            key[3]: record for key, record in sorted(self.records.items()) if key[:3] == (part, pair, arm)
        }

    def mixed(self) -> dict[str, dict[str, int]]:
        """By what runs were computed where they differ: how many by each version, device, precision."""
        found: dict[str, Counter[str]] = defaultdict(Counter)
        for record in self.records.values():
            for key, value in record.computed.items():
                found[key][value] += 1
        return {key: dict(sorted(counts.items())) for key, counts in found.items() if len(counts) > 1}

    def cases(self, pair: str) -> tuple[str | None, str]:
        """Source and target of a pair, by its runs; only those from scratch have no source."""
        runs = [r for (part, name, _, _), r in sorted(self.records.items()) if (part, name) == (PAIRS, pair)]
        source = next((r.source for r in runs if r.source), None)
        return source, runs[0].target

    def together(self, places: Mapping[str, tuple[str, str, str]]) -> dict[str, list[Record]]:
        """Runs by name, of the seeds that all of these (part, pair, arm) have, in order."""
        runs = {name: self.arm(*place) for name, place in places.items()}
        seeds = sorted(set.intersection(*(set(by_seed) for by_seed in runs.values())) if runs else set())
        return {name: [by_seed[seed] for seed in seeds] for name, by_seed in runs.items()}


def read_study(folder: Path) -> Study:
    """Read all runs below a folder; what cannot be read, or is no study's, is named in `broken`."""
    study = Study({})
    for path, part in find_runs(folder):
        try:
            if part not in PARTS:
                raise BrokenRunError(f"{part or folder} is no part of a study")
            record = read_placed(path, part)
        except BrokenRunError as error:
            study.broken.append((path, str(error)))
            continue
        study.records[part, record.pair, record.arm, record.seed] = record
    return Study(same_zero(study.records), study.broken)


def same_zero(records: Records) -> Records:
    """One zero of the score for a case: each run has drawn random actions of its own."""
    drawn: dict[str, list[float]] = {}
    for record in records.values():
        drawn.setdefault(record.target, []).append(record.random)
    return {key: replace(r, random=float(np.mean(drawn[r.target]))) for key, r in records.items()}


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
    claimed: Claimed = Claimed.above,
) -> list[Finding]:
    """A weighted sum of levels is above zero, or what else is claimed; nothing where runs are missing."""
    found_samples = samples(study, places, METRICS[metric])
    if not enough(found_samples):
        return []
    return [
        contrast(
            claim, f"{what} ({metric})", found_samples, weights, SEED, claimed, study.resamples, study.rough
        )
    ]


def steadier(
    study: Study, claim: str, where: str, places: Places, steady: str, other: str, metric: str
) -> list[Finding]:
    """One arm varies less over seeds than the other: logarithm of the ratio of standard deviations.

    Here and below `where` says in words what cases this is about.
    """
    values = samples(study, places, METRICS[metric])
    if not enough(values):
        return []
    p = brown_forsythe(values[steady], values[other])
    estimate = study.interval([values[steady], values[other]], steadiness, p)
    what = f"{where}: {steady} varies less than {other} ({metric}; log of the ratio of standard deviations)"
    return [found(claim, what, estimate, p, len(values[steady]))]


def rises(
    study: Study, claim: str, where: str, places: Places, order: Iterable[str], metric: str
) -> list[Finding]:
    """From arm to arm the level rises: the slope by least squares, and Page's test."""
    names = list(order)
    values = samples(study, places, METRICS[metric])
    if not enough(values):
        return []
    ordered = [values[name] for name in names]

    def rise(*arms: Sample, axis: int) -> Any:
        return slope([interquartile_mean(arm, axis) for arm in arms])

    # Two-sided: a fall contradicts.
    p = min(1.0, 2 * min(page_trend(ordered), page_trend(ordered[::-1])))
    estimate = study.interval(ordered, rise, p)
    what = f"{where}: {' < '.join(names)} ({metric}; slope)"
    return [found(claim, what, estimate, p, len(ordered[0]))]


def sooner(study: Study, claim: str, where: str, places: Places, early: str, late: str) -> list[Finding]:
    """One arm reaches the threshold earlier: share of episodes saved, and the log-rank test."""
    runs = study.together(places)
    if not enough(runs):
        return []
    times = {name: [time_to_threshold(r) for r in runs[name]] for name in (early, late)}
    length = len(runs[early][0].training.total)
    spent = {name: np.array([t for t, _ in found_times]) / length for name, found_times in times.items()}
    seen = {name: np.array([there for _, there in found_times]) for name, found_times in times.items()}
    seeds = len(seen[early])
    if not (seen[early].any() or seen[late].any()):
        # Nobody got there: there is nothing to compare.
        what = f"{where}: {early} sooner at the threshold than {late} (neither gets there)"
        return [found(claim, what, Estimate(0.0, -1.0, 1.0), 1.0, seeds)]

    def saved(a: Sample, b: Sample, axis: int) -> Any:
        return np.mean(b, axis=axis) - np.mean(a, axis=axis)

    p = log_rank((spent[early], seen[early]), (spent[late], seen[late]))
    if p <= LEVEL:
        # It is of many seeds; of few it is too small, and an exact test must agree.
        p = max(p, permutation(spent[early], spent[late], SEED))
    estimate = study.interval([spent[early], spent[late]], saved, p)
    what = f"{where}: {early} sooner at the threshold than {late} (share of the episodes)"
    return [found(claim, what, estimate, p, seeds)]
