"""Metrics of transfer from learning curves of any library: Taylor and Stone's (2009) and forward transfer.

Runs of all arms are compared on the steps that all of them have. Returns are scaled to scores: 0 is `low`, 1
is `high`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ship_trl.files.logs import LearningCurve
from ship_trl.study.analysis.metrics import EARLY, LAST, THRESHOLDS, WINDOW, first, last
from ship_trl.study.analysis.statistics import Estimate, resample

# Points along a curve, evenly over the steps; more do not change its mean.
POINTS = 1000
RESAMPLES = 2000

Scores = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """What scores 0 and 1, and the score to reach."""

    low: float
    high: float
    threshold: float = THRESHOLDS[0]


def scores(curves: Sequence[LearningCurve], steps: float, scale: Scale) -> Scores:
    """Return moving scores [runs, POINTS] of curves up to a number of steps."""
    grid = np.linspace(0.0, steps, POINTS)
    width = max(1, round(WINDOW * POINTS))
    # The mean of the points up to half a window to either side, fewer at the ends.
    weights = np.convolve(np.ones(POINTS), np.ones(width), "same")
    found = [
        np.convolve(np.interp(grid, one.steps, one.returns), np.ones(width), "same") / weights
        for one in curves
    ]
    return (np.array(found) - scale.low) / (scale.high - scale.low)


def measure(moving: Scores, threshold: float) -> dict[str, NDArray[np.float64]]:
    """Return each metric of moving scores [runs, POINTS], [runs].

    `time` is the share of the steps until the threshold is reached, 1 if it never is.
    """
    reached = moving >= threshold
    return {
        "start": first(moving.T, WINDOW).mean(0),
        "early area": first(moving.T, EARLY).mean(0),
        "area": moving.mean(1),
        "time": np.where(reached.any(1), reached.argmax(1) / (POINTS - 1), 1.0),
        "asymptote": last(moving.T, LAST).mean(0),
    }


def find_scale(arms: Mapping[str, Sequence[LearningCurve]], steps: float) -> Scale:
    """Return the scale from the least to the largest moving return of any run."""
    returns = np.concatenate([scores(curves, steps, Scale(0.0, 1.0)) for curves in arms.values()])
    low, high = float(returns.min()), float(returns.max())
    return Scale(low, high if high > low else low + 1.0)


def mean_estimate(values: NDArray[np.float64], rng: np.random.Generator) -> Estimate:
    """Return the mean over runs with its 95 % interval over resampled runs; unbounded for one run."""
    if len(values) < 2:
        return Estimate(float(values.mean()), -np.inf, np.inf)
    low, high = resample([values], np.mean, rng, RESAMPLES)
    return Estimate(float(values.mean()), float(low), float(high))


def compare(values: NDArray[np.float64], baseline: NDArray[np.float64], rng: np.random.Generator) -> Estimate:
    """Return the difference of means of two arms, whose runs are resampled apart, with its 95 % interval."""
    value = float(values.mean() - baseline.mean())
    if min(len(values), len(baseline)) < 2:
        return Estimate(value, -np.inf, np.inf)
    draws = [rng.choice(one, (RESAMPLES, len(one))).mean(1) for one in (values, baseline)]
    low, high = np.quantile(draws[0] - draws[1], (0.025, 0.975))
    return Estimate(value, float(low), float(high))


def forward_transfer(area: NDArray[np.float64], baseline: NDArray[np.float64]) -> float:
    """Return (area - baseline's) / (1 - baseline's), by mean areas (Continual World; Wolczyk et al., 2021).

    1 is all that could be gained, 0 nothing; NaN where the baseline leaves nothing to gain.
    """
    left = 1.0 - float(baseline.mean())
    return float(area.mean() - baseline.mean()) / left if left > 0 else float("nan")
