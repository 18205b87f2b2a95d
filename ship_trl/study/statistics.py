"""Estimates, intervals and tests of samples, which have one number for each seed.

Arms of a pair share their seeds, and so their source networks: differences within a seed are compared. The
estimate is their interquartile mean. Intervals and tests use the standard error of that mean (Yuen, 1974;
Tukey and McLaughlin, 1963), so a few collapsed runs do not decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite, isnan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

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
# O'Brien and Fleming's constants for 1 to 5 looks at a two-sided level of 0.05 (Jennison and Turnbull,
# 2000, table 2.3): at look k of K the critical z is the constant times the root of K / k.
OBRIEN_FLEMING = (1.960, 1.977, 2.004, 2.024, 2.040)
# With fewer seeds an interquartile mean cuts nothing off.
MIN_BAND_SEEDS, BAND_RESAMPLES = 4, 500
# Numbers of seeds to try: whole blocks, coarser as they grow.
SEED_COUNTS = (*range(5, 100, 5), *range(100, 300, 20), *range(300, 1001, 100))


@dataclass(frozen=True)
class Estimate:
    """A number with its interval; `low` and `high` equal the number where nothing varies."""

    value: float
    low: float
    high: float

    def interval(self) -> str:
        """Format the ends of the interval."""
        is_bounded = isfinite(self.low) and isfinite(self.high)
        return f"{self.low:+.3f} to {self.high:+.3f}" if is_bounded else "unbounded"

    def words(self, sign: str = "") -> str:
        """Format the number with its interval, without one where it is unbounded; - for NaN."""
        if isnan(self.value):
            return "-"
        value, low, high = (f"{number:{sign}.2f}" for number in (self.value, self.low, self.high))
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
    value = float(interquartile_mean(values))
    if len(values) < 2:
        return Estimate(value, -np.inf, np.inf)
    error, freedom = standard_error(values)
    reach = -float(special.stdtrit(freedom, level)) * error if error > TOLERANCE else 0.0
    return Estimate(value, value - reach, value + reach)


def p_above(values: Sample, bound: float = 0.0) -> float:
    """Return the one-sided p-value against an interquartile mean of at most `bound`."""
    value = float(interquartile_mean(values)) - bound
    error, freedom = standard_error(values)
    if error < TOLERANCE:
        return 0.0 if value > TOLERANCE else 1.0
    return float(special.stdtr(freedom, -value / error))


def p_below(values: Sample, bound: float = 0.0) -> float:
    """Return the one-sided p-value against an interquartile mean of at least `bound`."""
    return p_above(-values, -bound)


def p_within(values: Sample, margin: float) -> float:
    """Return the p-value against a mean beyond the margin: two one-sided tests (Schuirmann, 1987).

    It is 1 if nothing varies: then all runs are cut off at the same bound, which shows nothing.
    """
    if standard_error(values)[0] < TOLERANCE:
        return 1.0
    return max(p_below(values, margin), p_above(values, -margin))


def look_level(look: int, looks: int) -> float:
    """Return the one-sided level of a look, from 1 to `looks`; all looks together err in 2.5 % a side."""
    return float(stats.norm.sf(OBRIEN_FLEMING[looks - 1] * sqrt(looks / look)))


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


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values of a family of tests, adjusted by Holm's step-down method."""
    p = np.array(p_values, np.float64)
    order = np.argsort(p)
    factors = np.arange(len(p), 0, -1)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return [float(value) for value in adjusted]


def degrees_of_freedom(seeds: int) -> float:
    """Return the degrees of freedom of an interquartile mean; 0 or less where it has no error."""
    return FREEDOM_FACTOR * (seeds - 2 * int(TRIM * seeds) - 1)


@cache
def min_detectable_effect(seeds: int, level: float = LEVEL / 2, power: float = 0.8) -> float:
    """Return the least effect, in standard errors, that a one-sided t-test detects with this power.

    The power is a mean over quantiles of a chi distribution, because SciPy's noncentral t fails for few seeds
    and low levels.
    """
    freedom = degrees_of_freedom(seeds)
    if freedom <= 0:
        return np.inf
    quantiles = (np.arange(4_000) + 0.5) / 4_000
    chi = np.sqrt(stats.chi2.ppf(quantiles, freedom) / freedom)
    critical = stats.t.isf(level, freedom)

    def missing_power(effect: float) -> float:
        return float(np.mean(stats.norm.sf(critical * chi - effect)) - power)

    return float(optimize.brentq(missing_power, 0.0, 1e9))


def seeds_needed(difference: float, error: float, seeds: int, level: float, power: float) -> int | None:
    """Return how many seeds detect a difference; None if the error is unknown or 1,000 seeds are too few.

    `error` is the standard error with `seeds` seeds; it falls with the root of their number.
    """
    if not error > 0:
        return None
    # The root of an estimated variance is too small on average.
    error /= 1 - 1 / (4 * degrees_of_freedom(seeds))
    for count in SEED_COUNTS:
        if min_detectable_effect(count, level, power) * error * (seeds / count) ** 0.5 <= difference:
            return count
    return None


# All permutations of 12 seeds. The smallest p times the contrasts of a figure must allow a decision.
MAX_PERMUTATIONS = 2**12
TINY = float(np.finfo(np.float64).tiny)


def spread_test(
    steady: Sample,
    other: Sample,
    seed: int,
    level: float = LEVEL / 2,
    max_permutations: int = MAX_PERMUTATIONS,
) -> tuple[Estimate, float, float]:
    """Test by permutation whether the curves of one arm vary less over seeds than another's, [S, T] each.

    An arm's spread is the standard deviation over seeds, averaged along the curve. The statistic is the
    logarithm of the ratio of two spreads, divided by its jackknife error, so that it also holds for arms
    whose seeds vary in different ways (Janssen, 1997). Curves are deviations from their arm's mean curve, so
    levels do not count. A permutation exchanges the two arms of some seeds; few seeds have all permutations,
    many have `max_permutations` random ones.

    Returns:
        The logarithm, with its interval at the one-sided `level`, and the one-sided p-values against `steady`
        varying at least as much, and at most as much.
    """
    one, two = (curves - curves.mean(axis=0) for curves in (steady, other))
    seeds = len(one)
    if seeds < 3 or max(np.abs(one).max(), np.abs(two).max()) < TOLERANCE:
        return Estimate(log_spread_ratio(one, two), -np.inf, np.inf), 1.0, 1.0
    if 2**seeds <= max_permutations:
        swaps = (np.arange(2**seeds)[:, None] >> np.arange(seeds)) & 1
    else:
        swaps = np.random.default_rng(seed).integers(0, 2, (max_permutations, seeds))
        swaps[0] = 0
    ratios, errors = jackknife(one, two, swaps.astype(np.float64))
    value, error = float(ratios[0]), float(errors[0])  # the first permutation exchanges nothing
    standard = ratios / np.maximum(errors, TOLERANCE)
    rounding = 1e-9
    reach = float(np.quantile(np.abs(standard), 1 - 2 * level)) * error
    p = [float(np.mean(standard * sign >= standard[0] * sign - rounding)) for sign in (1, -1)]
    return Estimate(value, value - reach, value + reach), p[0], p[1]


def log_spread_ratio(one: Sample, two: Sample) -> float:
    """Return the logarithm of the spread of curves `two` over that of `one`."""
    spreads = [max(float(np.std(curves, axis=0, ddof=1).mean()), TINY) for curves in (one, two)]
    return float(np.log(spreads[1] / spreads[0]))


def jackknife(one: Sample, two: Sample, swaps: Sample) -> tuple[Sample, Sample]:
    """Return log ratios of spreads and their jackknife errors, [P] each.

    The curves of two arms, [S, T], have mean curves of zero. `swaps`, [P, S], are 1 where a permutation
    exchanges the arms of a seed.
    """
    seeds = len(one)

    def ratio(first: tuple[Sample, Sample], second: tuple[Sample, Sample], count: int) -> Sample:
        spreads = [
            np.sqrt(np.maximum(squares - total**2 / count, 0.0) / (count - 1)).mean(axis=1)
            for total, squares in (first, second)
        ]
        found: Sample = np.log(np.maximum(spreads[1], TINY) / np.maximum(spreads[0], TINY))
        return found

    change, change_squared = two - one, two**2 - one**2
    totals, squares = (one + two).sum(axis=0), (one**2 + two**2).sum(axis=0)
    total, square = one.sum(axis=0) + swaps @ change, (one**2).sum(axis=0) + swaps @ change_squared
    left_out = np.empty((seeds, len(swaps)))
    for k in range(seeds):
        mine, mine_squared = (
            values[k] + swaps[:, k : k + 1] * by
            for values, by in ((one, change[k]), (one**2, change_squared[k]))
        )
        first = total - mine, square - mine_squared
        second = (
            totals - total - (one[k] + two[k] - mine),
            squares - square - (one[k] ** 2 + two[k] ** 2 - mine_squared),
        )
        left_out[k] = ratio(first, second, seeds - 1)
    errors = np.sqrt((seeds - 1) / seeds * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    return ratio((total, square), (totals - total, squares - square), seeds), errors
