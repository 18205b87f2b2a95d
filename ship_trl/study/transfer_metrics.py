"""Metrics of transfer from learning curves of any library: Taylor and Stone's (2009) and forward transfer.

Runs of all arms are compared on the steps that all of them have. Returns are scaled to scores: 0 is `low`, 1
is `high`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ship_trl.files.logs import LearningCurve
from ship_trl.study.metrics import EARLY, LAST, THRESHOLDS, WINDOW, first, last
from ship_trl.study.statistics import Estimate

# Parts of the steps, in each of which returns are averaged.
POINTS = 200
LEVEL = 0.975

Scores = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """The returns that score 0 and 1, and the score to reach."""

    low: float
    high: float
    threshold: float = THRESHOLDS[0]


def scores(curves: Sequence[LearningCurve], steps: float, scale: Scale) -> Scores:
    """Return moving scores [runs, POINTS] of curves up to a number of steps."""
    width = max(1, round(WINDOW * POINTS))
    # The mean of the parts up to half a window to either side, fewer at the ends.
    weights = np.convolve(np.ones(POINTS), np.ones(width), "same")
    moving = [np.convolve(means(one, steps), np.ones(width), "same") / weights for one in curves]
    return (np.array(moving) - scale.low) / (scale.high - scale.low)


def means(curve: LearningCurve, steps: float) -> NDArray[np.float64]:
    """Return the mean return in each part of the steps, [POINTS]; a return holds for the steps before it."""
    ends = np.concatenate(([0.0], curve.steps))
    total = np.concatenate(([0.0], np.cumsum(np.diff(ends) * curve.returns)))
    parts: NDArray[np.float64] = np.diff(np.interp(np.linspace(0.0, steps, POINTS + 1), ends, total))
    return parts * POINTS / steps


def measure(moving: Scores, threshold: float) -> dict[str, NDArray[np.float64]]:
    """Return each metric of moving scores [runs, POINTS], [runs].

    `time` is the share of the steps until the threshold is reached, 1 if it never is.
    """
    reached = moving >= threshold
    return {
        "start": first(moving.T, WINDOW).mean(0),
        "early area": first(moving.T, EARLY).mean(0),
        "area": moving.mean(1),
        "time": np.where(reached.any(1), (reached.argmax(1) + 0.5) / POINTS, 1.0),
        "asymptote": last(moving.T, LAST).mean(0),
    }


def measure_arms(
    arms: Mapping[str, Sequence[LearningCurve]], steps: float, scale: Scale
) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Return each metric of each arm's runs, [runs]; those that no run has are left out."""
    found = {}
    for name, curves in arms.items():
        rates = [last(one.success_rates).mean() if one.success_rates.size else np.nan for one in curves]
        found[name] = measure(scores(curves, steps, scale), scale.threshold)
        found[name] |= {
            "greedy success": np.array(rates),
            "forgetting": np.array([one.forgetting for one in curves]),
        }
    measured = {
        key for values in found.values() for key, numbers in values.items() if np.isfinite(numbers).any()
    }
    return {name: {k: v for k, v in values.items() if k in measured} for name, values in found.items()}


def find_scale(arms: Mapping[str, Sequence[LearningCurve]], steps: float) -> Scale:
    """Return the scale of `RunRecord.score`: 0 is random actions, 1 the best known return.

    If no runs of one target say both, it goes from the least to the largest moving return of any run.
    """
    known = {one.known for curves in arms.values() for one in curves if one.known is not None}
    if len(known) == 1:
        return Scale(*known.pop())
    returns = np.concatenate([scores(curves, steps, Scale(0.0, 1.0)) for curves in arms.values()])
    low, high = float(returns.min()), float(returns.max())
    return Scale(low, high if high > low else low + 1.0)


def estimate(value: float, samples: Sequence[NDArray[np.float64]]) -> Estimate:
    """Return a mean or a difference of means with Student's or Welch's (1947) 95 % interval.

    `samples` are the independent samples that it is made of. It is unbounded for a sample of one run.
    """
    if any(len(one) < 2 for one in samples):
        return Estimate(value, -np.inf, np.inf)
    parts = np.array([np.var(one, ddof=1) / len(one) for one in samples])
    if not parts.sum():
        return Estimate(value, value, value)
    freedom = parts.sum() ** 2 / sum(
        part**2 / (len(one) - 1) for part, one in zip(parts, samples, strict=True)
    )
    reach = float(special.stdtrit(freedom, LEVEL)) * float(np.sqrt(parts.sum()))
    return Estimate(value, value - reach, value + reach)


def forward_transfer(
    area: NDArray[np.float64], baseline: NDArray[np.float64], paired: bool = False
) -> Estimate:
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
    return estimate(value, [own - other] if paired else [own, other])
