"""The kinds of contrast that are measured on a study's runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ship_trl.study.analysis.contrasts import Claimed, Finding, contrast
from ship_trl.study.analysis.metrics import TIMES, curve, measure, reached
from ship_trl.study.analysis.statistics import Estimate, Sample, level_of, spread_test
from ship_trl.study.analysis.study import Place, Places, Study
from ship_trl.study.margins import margin

# Of all resampling: the same study gives the same report.
SEED = 2022
# The metric of curves that vary less than others; all else are levels.
SPREAD = "spread"
# Times of arms can be called equal if at least this share of the runs of each got there.
REACHED = 0.75
# What stands beside a metric to show whether the choice of it decides.
SENSITIVITY = {
    "area": ("greedy area",),
    "asymptote": ("greedy asymptote",),
    "time": ("time to 0.5", "time to 0.8"),
}


def levels(
    study: Study,
    claim: str,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    claimed: Claimed = Claimed.above,
) -> list[Finding]:
    """Measure a weighted sum of arms within each seed, above zero or what else is claimed.

    Nothing where there are less than two seeds that all arms have.
    """
    runs = study.matched(places)
    if min(map(len, runs.values()), default=0) < 2:
        return []

    def differences(of: str) -> Sample:
        parts = [share * np.array([measure(r, of) for r in runs[name]]) for name, share in weights.items()]
        return np.sum(parts, axis=0)

    bound = margin(next(iter(runs.values()))[0].target, metric)
    if metric in TIMES and any(np.mean([reached(r) for r in records]) < REACHED for records in runs.values()):
        # Runs that are cut off at their end are not alike because their times are.
        bound = None
    found = contrast(claim, f"{what} ({metric})", metric, differences(metric), bound, claimed, study.level)
    beside = {name: level_of(differences(name), study.level) for name in SENSITIVITY.get(metric, ())}
    return [replace(found, beside=beside)]


def steadier(study: Study, claim: str, where: str, places: Places, steady: str, other: str) -> list[Finding]:
    """Measure how much less one arm's curves vary over seeds than another's (see `spread_test`)."""
    runs = study.matched(places)
    if min(map(len, runs.values())) < 2:
        return []
    curves = {name: np.stack([curve(record) for record in runs[name]]) for name in (steady, other)}
    estimate, p, against = spread_test(curves[steady], curves[other], SEED, study.level, study.resamples)
    what = f"{where}: {steady} varies less than {other} ({SPREAD}; logarithm of the ratio)"
    return [Finding(claim, what, SPREAD, estimate, p, against, seeds=len(curves[steady]))]


def above_scratch(study: Study, place: Place, scratch: Place, metric: str = "area") -> np.ndarray:
    """Return the differences from scratch in a metric [S], of the seeds that both have."""
    runs = study.matched({"arm": place, "scratch": scratch})
    arm, other = (np.array([measure(run, metric) for run in runs[name]]) for name in ("arm", "scratch"))
    return arm - other


def gain(study: Study, place: Place, scratch: Place, metric: str = "area") -> Estimate | None:
    """Return the difference from scratch in a metric: interquartile mean, and interval of the study's level.

    None without seeds that both have; of one seed the interval has no ends.
    """
    differences = above_scratch(study, place, scratch, metric)
    return level_of(differences, study.level) if len(differences) else None
