"""Contrasts between arms: estimate, interval, and the p-values behind verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from ship_trl.study.margins import margin
from ship_trl.study.metrics import TIMES, curve, has_reached, measure
from ship_trl.study.statistics import (
    LEVEL,
    Estimate,
    Sample,
    estimate_mean,
    min_detectable_effect,
    p_above,
    p_below,
    p_within,
    spread_test,
    standard_error,
)
from ship_trl.study.study import Place, Places, Study

# With fewer seeds there is no verdict: two or three cannot show how seeds vary.
MIN_SEEDS = 5
# The seed of all resampling, so that the same study gives the same report.
SEED = 2022
SPREAD = "spread"
# Times can be equivalent only if at least this share of each arm's runs reaches the threshold.
MIN_REACHED = 0.75
# Further metrics reported beside a metric; they decide nothing.
SENSITIVITY = {
    "area": ("greedy area",),
    "asymptote": ("greedy asymptote",),
    "time": ("time to 0.5", "time to 0.8"),
}


class Verdict(StrEnum):
    """What the runs say about a claim."""

    supported = "supported"
    contradicted = "contradicted"
    equivalent = "equivalent"
    inconclusive = "inconclusive"


class Claimed(StrEnum):
    """What a claim says about a contrast."""

    above = "above zero"
    no_more = "not above the margin"


@dataclass(frozen=True)
class Finding:
    """A measured contrast; positive is the claimed direction.

    Estimate, interval and p-values are of the interquartile mean over seeds of the difference within a seed,
    or of the logarithm of a ratio of spreads. All p-values are one-sided.

    `p` is for the claim, `against` for its opposite, `adjusted` is `against` adjusted by Holm's method over
    all contrasts of the figure, and `within` is for a difference within the margin (1 without a margin).
    `error` is the standard error; spreads have none. `beside` holds the same contrast in further metrics.
    `differences` are by seed; spreads have none.
    """

    what: str
    metric: str
    estimate: Estimate
    p: float
    against: float
    seeds: int
    claimed: Claimed = Claimed.above
    margin: float | None = None
    within: float = 1.0
    error: float = np.nan
    adjusted: float = 1.0
    verdict: Verdict = Verdict.inconclusive
    beside: Mapping[str, Estimate] = field(default_factory=dict)
    differences: tuple[float, ...] = ()

    @property
    def as_claimed(self) -> bool:
        """Whether the estimate, however uncertain, agrees with the claim."""
        value = self.estimate.value
        return value > 0 if self.claimed is Claimed.above else value <= (self.margin or 0.0)

    def min_detectable(self, level: float = LEVEL / 2) -> float:
        """Return the least difference that these seeds detect four times in five at a level."""
        return min_detectable_effect(self.seeds, level) * self.error


@dataclass(frozen=True)
class Gain(Estimate):
    """How much an arm is above scratch, and over how many seeds."""

    seeds: int


def contrast(
    what: str,
    metric: str,
    differences: Sample,
    margin: float | None = None,
    claimed: Claimed = Claimed.above,
    level: float = LEVEL / 2,
) -> Finding:
    """Measure differences by seed, [S]; the interval leaves out `level` at each end."""
    if claimed is Claimed.above:
        p, against = p_above(differences), p_below(differences)
    elif margin is not None:
        p, against = p_below(differences, margin), p_above(differences, margin)
    else:
        p, against = 1.0, 1.0
    return Finding(
        what,
        metric,
        estimate_mean(differences, level),
        p,
        against,
        seeds=len(differences),
        claimed=claimed,
        margin=margin,
        within=1.0 if margin is None else p_within(differences, margin),
        error=standard_error(differences)[0],
        differences=tuple(map(float, differences)),
    )


def measure_levels(
    study: Study,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    claimed: Claimed = Claimed.above,
) -> list[Finding]:
    """Measure a weighted sum of arms within each seed; return nothing for fewer than two common seeds."""
    runs = study.matched(places)
    if min(map(len, runs.values()), default=0) < 2:
        return []

    def differences(of: str) -> Sample:
        parts = [share * np.array([measure(r, of) for r in runs[name]]) for name, share in weights.items()]
        return np.sum(parts, axis=0)

    bound = margin(next(iter(runs.values()))[0].target, metric)
    # Times of runs that never reach the threshold are equal without being alike.
    if metric in TIMES and min(np.mean([*map(has_reached, arm)]) for arm in runs.values()) < MIN_REACHED:
        bound = None
    found = contrast(f"{what} ({metric})", metric, differences(metric), bound, claimed, study.level)
    beside = {name: estimate_mean(differences(name), study.level) for name in SENSITIVITY.get(metric, ())}
    return [replace(found, beside=beside)]


def measure_spread(study: Study, where: str, places: Places, steady: str, other: str) -> list[Finding]:
    """Measure how much less one arm's curves vary over seeds than another's."""
    runs = study.matched(places)
    if min(map(len, runs.values())) < 2:
        return []
    one, two = (np.stack([curve(record) for record in runs[name]]) for name in (steady, other))
    estimate, p, against = spread_test(one, two, SEED, study.level, study.max_permutations)
    what = f"{where}: {steady} varies less than {other} ({SPREAD}; logarithm of the ratio)"
    return [Finding(what, SPREAD, estimate, p, against, seeds=len(one))]


def gain(study: Study, place: Place, scratch: Place, metric: str = "area") -> Gain | None:
    """Return how much an arm is above scratch, at the study's level; None without common seeds."""
    runs = study.matched({"arm": place, "scratch": scratch})
    arm, other = (np.array([measure(run, metric) for run in runs[name]]) for name in ("arm", "scratch"))
    if not len(arm):
        return None
    found = estimate_mean(arm - other, study.level)
    return Gain(found.value, found.low, found.high, len(arm))
