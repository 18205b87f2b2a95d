"""Estimates, intervals and tests of samples, which have one number for each seed.

Arms of a pair share their seeds, and so their source networks: differences within a seed are compared. The
estimate is their interquartile mean. Intervals and tests use the standard error of that mean (Yuen, 1974;
Tukey and McLaughlin, 1963), so a few collapsed runs do not decide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, isnan, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

Sample = NDArray[np.float64]
# With this many resamples the ends of a 95 % interval vary by less than a hundredth of its width.
RESAMPLES = 10_000
CONFIDENCE = 0.95
# Two-sided error of a test.
LEVEL = 0.05
# The share that an interquartile mean cuts off at each end.
TRIM = 0.25
# Tests with Yuen's degrees of freedom err too often at the small p of looks and Holm's method: 8 % for 5 %,
# simulated with 11 claims and three looks. With four fifths of them they err as often as stated.
FREEDOM_FACTOR = 0.8
# Numbers that differ by less are equal.
TOLERANCE = 1e-12
# With fewer seeds an interquartile mean cuts nothing off.
MIN_BAND_SEEDS, BAND_RESAMPLES = 4, 500


@dataclass(frozen=True)
class Estimate:
    """A number with its interval, most often a difference; `low` and `high` equal it where nothing varies.

    `what` says what it is, `seeds` of how many, `differences` holds it for each, and `beside` the same in
    further metrics. `error` is the standard error. `p` is one-sided for what is claimed of it, above zero
    where nothing else is said, `against` for the opposite, and `within` for a difference within the `margin`;
    each is 1 where it was not tested.
    """

    value: float
    low: float
    high: float
    seeds: int = 0
    what: str = ""
    metric: str = ""
    p: float = 1.0
    against: float = 1.0
    margin: float | None = None
    within: float = 1.0
    error: float = nan
    differences: tuple[float, ...] = ()
    beside: Mapping[str, Estimate] = field(default_factory=dict)

    def interval(self) -> str:
        """Format the ends of the interval."""
        is_bounded = isfinite(self.low) and isfinite(self.high)
        return f"{self.low:+.3f} to {self.high:+.3f}" if is_bounded else "unbounded"

    def words(self, sign: str = "", digits: int = 2) -> str:
        """Format the number with its interval, without one where it is unbounded; - for NaN."""
        if isnan(self.value):
            return "-"
        value, low, high = (f"{number:{sign}z.{digits}f}" for number in (self.value, self.low, self.high))
        return f"{value} ({low} to {high})" if isfinite(self.low) else value

    def cells(self, name: str, mark: str = " ") -> dict[str, Any]:
        """Return the columns `name`, `name low` and `name high` of a table, with `mark` for the space."""
        return {name: self.value, f"{name}{mark}low": self.low, f"{name}{mark}high": self.high}


def interquartile_mean(values: Sample, axis: int = -1) -> Any:
    """Return the mean without the outer quarters: without 1, 2, 3 of 5, 10, 15 seeds at each end."""
    # SciPy's trim_mean takes fifty times as long, and a report needs half a million means.
    ordered = np.sort(values, axis=axis)
    count = ordered.shape[axis]
    cut = int(TRIM * count)
    return np.mean(np.take(ordered, np.arange(cut, count - cut), axis=axis), axis=axis)


def standard_error(values: Sample) -> tuple[float, float]:
    """Return Yuen's standard error of the interquartile mean, and its degrees of freedom.

    If the middle half does not vary, this is the error of the plain mean: seeds may agree by chance, for
    example where runs never reach the threshold.
    """
    count = len(values)
    cut = int(TRIM * count)
    kept = count - 2 * cut
    ordered = np.sort(values)
    winsorised = np.clip(values, ordered[cut], ordered[count - cut - 1])
    squares = float(np.sum((winsorised - winsorised.mean()) ** 2))
    if squares < TOLERANCE**2:
        return float(np.std(values, ddof=1)) / sqrt(count), count - 1
    return sqrt(squares / (kept * (kept - 1))), degrees_of_freedom(count)


def estimate_mean(values: Sample, level: float = LEVEL / 2) -> Estimate:
    """Return the interquartile mean over seeds; its interval leaves out `level` at each end."""
    value, seeds = float(interquartile_mean(values)), len(values)
    if seeds < 2:
        return Estimate(value, -np.inf, np.inf, seeds)
    error, freedom = standard_error(values)
    reach = -float(special.stdtrit(freedom, level)) * error if error > TOLERANCE else 0.0
    return Estimate(value, value - reach, value + reach, seeds, error=error)


def welch(value: float, samples: Sequence[Sample]) -> Estimate:
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
    reach = float(special.stdtrit(freedom, 1 - LEVEL / 2)) * float(np.sqrt(parts.sum()))
    return Estimate(value, value - reach, value + reach)


def bootstrap(samples: Sequence[Sample], statistic: Callable[..., Any], seed: int) -> Estimate:
    """Return a statistic of samples with its 95 % interval over seeds, which are resampled jointly."""
    low, high = resample(samples, statistic, np.random.default_rng(seed), RESAMPLES)
    return Estimate(float(statistic(*samples, axis=-1)), float(low), float(high))


def band(curves: Sample, rng: np.random.Generator) -> tuple[Sample, Sample, Sample]:
    """Return the interquartile mean of curves [S, T] over seeds, and the ends of its 95 % interval: [T] each.

    The interval is over resampled seeds, at each point by itself. Unlike mean and standard deviation it stays
    within the range of the curves, so it cannot pass the best possible return.
    """
    ends = resample([np.ascontiguousarray(curves.T)], interquartile_mean, rng, BAND_RESAMPLES)
    # Rounding may leave the range by a digit, and the percentiles of skewed seeds may leave out the mean.
    least, most = curves.min(axis=0), curves.max(axis=0)
    middle = np.clip(interquartile_mean(curves, axis=0), least, most)
    low, high = (np.clip(end, least, most) for end in ends)
    return middle, np.minimum(low, middle), np.maximum(high, middle)


def resample(
    samples: Sequence[Sample], statistic: Callable[..., Any], rng: np.random.Generator, count: int
) -> tuple[Any, Any]:
    """Return the ends of a statistic's 95 % percentile interval; seeds are the last axis."""
    found = stats.bootstrap(
        tuple(samples),
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=count,
        confidence_level=CONFIDENCE,
        method="percentile",
        axis=-1,
        rng=rng,
        batch=2_000,  # bounds the memory
    )
    return found.confidence_interval


def permutation(one: Sample, other: Sample, seed: int) -> float:
    """Return the p-value of equal means of two independent samples, exact where they are small."""

    def difference(a: Sample, b: Sample, axis: int) -> Any:
        return np.mean(a, axis=axis) - np.mean(b, axis=axis)

    rng = np.random.default_rng(seed)
    return float(stats.permutation_test((one, other), difference, n_resamples=RESAMPLES, rng=rng).pvalue)


def share_interval(count: int, of: int) -> Estimate:
    """Return a share with its 95 % interval (Wilson, 1927)."""
    ends = stats.binomtest(count, of).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(count / of, float(ends.low), float(ends.high))


def degrees_of_freedom(seeds: int) -> float:
    """Return the degrees of freedom of an interquartile mean; 0 or less where it has no error."""
    return FREEDOM_FACTOR * (seeds - 2 * int(TRIM * seeds) - 1)
