"""The statistics of a study: one number a seed, one estimand, one test that speaks of it.

A sample is one number a seed. Arms of a pair share their seeds, and with them their source networks, so
what is compared is the difference within each seed. Its interquartile mean is estimated, bounded and
tested by one and the same standard error (Yuen, 1974; Tukey and McLaughlin, 1963): a few seeds whose run
fell into colliding do not decide a level.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

Sample = NDArray[np.float64]
# Of resamples: the ends of a 95 % interval then vary by less than a hundredth of its width.
RESAMPLES = 10_000
CONFIDENCE = 0.95
# Of arms changing places: all ways of twelve seeds. Times the contrasts of a figure, the least p decides.
SWAPS = 2**12
# A test errs so often, on both sides together.
LEVEL = 0.05
# Cut off at each end by an interquartile mean.
TRIMMED = 0.25
# Yuen's degrees of freedom err more than they say where looks and Holm's method ask for a small p: of 11
# claims and three looks 8 % for 5 %. With four fifths of them the calibration is as stated.
FREEDOM = 0.8
# Numbers of two seeds that differ by less do not vary.
SAME = 1e-12
# O'Brien and Fleming's constants for 1 to 5 looks at a two-sided level of 0.05 (Jennison and Turnbull,
# 2000, table 2.3): at look k of K the critical z is the constant times the root of K / k.
OBRIEN_FLEMING = (1.960, 1.977, 2.004, 2.024, 2.040)


@dataclass(frozen=True)
class Estimate:
    """A number with its interval; `low` and `high` are the number itself where nothing varies."""

    value: float
    low: float
    high: float


def interquartile_mean(values: Sample, axis: int = -1) -> Any:
    """Return the mean without the outer quarters, each rounded down: of 5, 10, 15 seeds 1, 2, 3 at an end.

    It is robust to single seeds, and counts more of them than the median does.
    """
    # By hand: SciPy's trim_mean takes fifty times as long, and a report needs half a million.
    ordered = np.sort(values, axis=axis)
    count = ordered.shape[axis]
    cut = int(TRIMMED * count)
    return np.mean(np.take(ordered, np.arange(cut, count - cut), axis=axis), axis=axis)


def standard_error(values: Sample) -> tuple[float, float]:
    """Return Yuen's standard error of an interquartile mean of [S] numbers, and its degrees of freedom.

    Where the middle half does not vary but the rest does, the mean's own error is taken: some seeds that
    happen to agree (runs censored at their end do) are not certainty.
    """
    count = len(values)
    cut = int(TRIMMED * count)
    kept = count - 2 * cut
    ordered = np.sort(values)
    winsorised = np.clip(values, ordered[cut], ordered[count - cut - 1])
    squares = float(np.sum((winsorised - winsorised.mean()) ** 2))
    if squares < SAME**2:
        return float(np.std(values, ddof=1)) / sqrt(count), count - 1
    return sqrt(squares / (kept * (kept - 1))), FREEDOM * (kept - 1)


def level_of(values: Sample, level: float = LEVEL / 2) -> Estimate:
    """Return the interquartile mean over seeds with the interval that a one-sided `level` leaves out."""
    value = float(interquartile_mean(values))
    if len(values) < 2:
        return Estimate(value, -np.inf, np.inf)
    error, freedom = standard_error(values)
    reach = -float(special.stdtrit(freedom, level)) * error if error > SAME else 0.0
    return Estimate(value, value - reach, value + reach)


def p_above(values: Sample, bound: float = 0.0) -> float:
    """Return the one-sided p that an interquartile mean over seeds is `bound` or less."""
    value = float(interquartile_mean(values)) - bound
    error, freedom = standard_error(values)
    if error < SAME:
        # Nothing varies: what is there, is there.
        return 0.0 if value > SAME else 1.0
    return float(special.stdtr(freedom, -value / error))


def p_below(values: Sample, bound: float = 0.0) -> float:
    """Return the one-sided p that an interquartile mean over seeds is `bound` or more."""
    return p_above(-values, -bound)


def p_within(values: Sample, margin: float) -> float:
    """Return the p of a level beyond a margin on either side: two one-sided tests (Schuirmann, 1987).

    Numbers that do not vary at all show nothing: they are bounds that all runs have met.
    """
    if standard_error(values)[0] < SAME:
        return 1.0
    return max(p_below(values, margin), p_above(values, -margin))


def look_level(look: int, looks: int) -> float:
    """Return the one-sided level at look 1 to `looks`, which together err in 2.5 % on each side.

    Raises:
        ValueError: more looks than there are constants for.
    """
    if not 1 <= look <= looks <= len(OBRIEN_FLEMING):
        raise ValueError(f"look {look} of {looks}: from 1 to {len(OBRIEN_FLEMING)} looks are allowed")
    return float(stats.norm.sf(OBRIEN_FLEMING[looks - 1] * sqrt(looks / look)))


def spread_test(
    steady: Sample, other: Sample, seed: int, level: float = LEVEL / 2, resamples: int = SWAPS
) -> tuple[Estimate, float, float]:
    """Test by permutation whether one arm's curves vary less over seeds than another's.

    Curves are [S, T]. An arm's spread is the standard deviation over seeds, its mean along the curve: the
    shaded area of the paper's figures. Compared is the logarithm of the ratio of two spreads, divided by
    its jackknife error, so that arms whose seeds vary in different ways are no false finding (Janssen,
    1997). Curves are taken as deviations from their arm's mean curve, so that a difference of levels is
    none of spread, and the arms of a seed change places: in all ways, where those are few.

    Returns:
        The logarithm with the interval of the same permutations, and one-sided p that `steady` varies as
        much or more, and that it varies as much or less.
    """
    one, two = (curves - curves.mean(axis=0) for curves in (steady, other))
    seeds = len(one)
    if seeds < 3 or max(np.abs(one).max(), np.abs(two).max()) < SAME:
        return Estimate(log_ratio(one, two), -np.inf, np.inf), 1.0, 1.0
    if 2**seeds <= resamples:
        swaps = (np.arange(2**seeds)[:, None] >> np.arange(seeds)) & 1
    else:
        swaps = np.random.default_rng(seed).integers(0, 2, (resamples, seeds))
        swaps[0] = 0
    ratios, errors = jackknifed(one, two, swaps.astype(np.float64))
    value, error = float(ratios[0]), float(errors[0])  # nothing has changed places
    standard = ratios / np.maximum(errors, SAME)
    close = 1e-9  # the same up to rounding counts as reached
    reach = float(np.quantile(np.abs(standard), 1 - 2 * level)) * error
    p = [float(np.mean(standard * sign >= standard[0] * sign - close)) for sign in (1, -1)]
    return Estimate(value, value - reach, value + reach), p[0], p[1]


def log_ratio(one: Sample, two: Sample) -> float:
    """Return the logarithm of how much larger the spread of curves `two` is than that of `one`."""
    tiny = np.finfo(np.float64).tiny
    spreads = [max(float(np.std(curves, axis=0, ddof=1).mean()), tiny) for curves in (one, two)]
    return float(np.log(spreads[1] / spreads[0]))


def jackknifed(one: Sample, two: Sample, swaps: Sample) -> tuple[Sample, Sample]:
    """Return log ratios of spreads and their jackknife errors: [P] each.

    Curves [S, T] change places by seed where `swaps` [P, S] is 1.
    """
    seeds = len(one)

    def ratio(first: tuple[Sample, Sample], second: tuple[Sample, Sample], count: int) -> Sample:
        spreads = [
            np.sqrt(np.maximum(squares - total**2 / count, 0.0) / (count - 1)).mean(axis=1)
            for total, squares in (first, second)
        ]
        tiny = np.finfo(np.float64).tiny
        found: Sample = np.log(np.maximum(spreads[1], tiny) / np.maximum(spreads[0], tiny))
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


def bootstrap(
    samples: Sequence[Sample],
    statistic: Callable[..., Any],
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = CONFIDENCE,
) -> Estimate:
    """Return a statistic of samples with its percentile interval over resampled seeds, for description.

    Args:
        samples: of equal length [S], in the order of the seeds, which are drawn jointly.
        statistic: takes the samples and `axis`, along which seeds lie.
        seed: of the resampling.
        resamples: how many.
        confidence: what share of them the interval holds.

    Raises:
        ValueError: fewer than two seeds.
    """
    if len(samples[0]) < 2:
        raise ValueError("a bootstrap needs at least two seeds")
    value = float(statistic(*samples, axis=-1))
    found = stats.bootstrap(
        tuple(samples),
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=resamples,
        confidence_level=confidence,
        method="percentile",
        rng=np.random.default_rng(seed),
        # A few thousand at a time bound the memory.
        batch=2_000,
    )
    interval = found.confidence_interval
    return Estimate(value, float(interval.low), float(interval.high))


def permutation(one: Sample, other: Sample, seed: int) -> float:
    """Return the p of equal means of two independent samples, exact where they are small."""

    def gap(a: Sample, b: Sample, axis: int) -> Any:
        return np.mean(a, axis=axis) - np.mean(b, axis=axis)

    return float(
        stats.permutation_test(
            (one, other), gap, vectorized=True, n_resamples=RESAMPLES, rng=np.random.default_rng(seed)
        ).pvalue
    )


def share_interval(count: int, of: int) -> Estimate:
    """Return a share with its 95 % interval (Wilson, 1927)."""
    ends = stats.binomtest(count, of).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(count / of, float(ends.low), float(ends.high))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values of a family of tests, adjusted by Holm's step-down method."""
    from statsmodels.stats.multitest import multipletests

    if not p_values:
        return []
    # It collects garbage each time, and would look through a whole study for it.
    gc.freeze()
    try:
        return [float(p) for p in multipletests(list(p_values), method="holm")[1]]
    finally:
        gc.unfreeze()
