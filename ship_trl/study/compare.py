"""Compare arms: weighted sums of them within each seed, gains over scratch, and forward transfer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ship_trl.study.metrics import METRICS, TIMES, measure
from ship_trl.study.plan import Place
from ship_trl.study.statistics import Estimate, Sample, estimate_mean, welch
from ship_trl.study.study import Places, Study

# With fewer seeds no interval is shown of an arm: two or three cannot show how seeds vary.
MIN_SEEDS = 5
# The seed of all resampling, so that the same study gives the same report.
SEED = 2022
# Further metrics reported beside a metric.
SENSITIVITY = {
    "area": ("greedy area",),
    "asymptote": ("greedy asymptote",),
    "time": ("time to 0.5", "time to 0.8"),
}


@dataclass(frozen=True)
class Contrast:
    """A sum of arms with `weights` within each seed, in a metric; `what` says it in words."""

    what: str
    metric: str
    places: Places
    weights: Mapping[str, float]

    def measure(self, study: Study) -> Estimate | None:
        """Return the interquartile mean over seeds at the study's level; None below two common seeds."""
        runs = study.matched(self.places)
        if min(map(len, runs.values()), default=0) < 2:
            return None

        def differences(metric: str) -> Sample:
            parts = [
                share * np.array([measure(run, metric) for run in runs[name]])
                for name, share in self.weights.items()
            ]
            return np.sum(parts, axis=0)

        values = differences(self.metric)
        others = SENSITIVITY.get(self.metric, ())
        return replace(
            estimate_mean(values, study.level),
            what=self.what,
            metric=self.metric,
            differences=tuple(map(float, values)),
            beside={name: estimate_mean(differences(name), study.level) for name in others},
        )


def comparative(metric: str) -> str:
    """Return the word for the better side of a contrast."""
    return "sooner than" if metric in TIMES else "above"


def joined(arms: Sequence[str]) -> str:
    """Name some arms as one side of a contrast."""
    return arms[0] if len(arms) == 1 else f"mean of {', '.join(arms)}"


def mean_difference(better: Sequence[str], worse: Sequence[str]) -> dict[str, float]:
    """Return the weights of the mean of some arms less the mean of others."""
    weights = dict.fromkeys(better, 1 / len(better))
    for arm in worse:
        weights[arm] = weights.get(arm, 0.0) - 1 / len(worse)
    return weights


def weighted(where: str, what: str, places: Places, weights: Mapping[str, float], metric: str) -> Contrast:
    """Make a contrast of a weighted sum of arms, with the opposite sign for times, where less is better."""
    if metric not in METRICS:
        raise ValueError(f"{where}, {what}: no metric {metric}; allowed: {', '.join(METRICS)}")
    sign = -1.0 if metric in TIMES else 1.0
    signed = {name: sign * weight for name, weight in weights.items()}
    return Contrast(f"{where}: {what} ({metric})", metric, {name: places[name] for name in weights}, signed)


def gain(study: Study, place: Place, scratch: Place, metric: str = "area") -> Estimate | None:
    """Return how much an arm is above scratch, at the study's level; None without common seeds."""
    runs = study.matched({"arm": place, "scratch": scratch})
    arm, other = (np.array([measure(run, metric) for run in runs[name]]) for name in ("arm", "scratch"))
    return estimate_mean(arm - other, study.level) if len(arm) else None


def forward_transfer(area: Sample, baseline: Sample, paired: bool = False) -> Estimate:
    """Return (area - baseline's) / (1 - baseline's), by mean areas (Continual World; Wolczyk et al., 2021).

    1 is all that could be gained, 0 nothing; NaN where the baseline leaves nothing to gain. The 95 % interval
    is Student's, or Welch's unless run k of both is `paired` by its seed, of the ratio's linear part in the
    two means (the delta method).
    """
    left = 1.0 - float(baseline.mean())
    if left <= 0:
        return Estimate(np.nan, np.nan, np.nan)
    value = float(area.mean() - baseline.mean()) / left
    # The ratio's derivatives by the mean areas are 1 / left and -(1 - value) / left.
    own, other = area / left, (1.0 - value) * baseline / left
    return welch(value, [own - other] if paired else [own, other])
