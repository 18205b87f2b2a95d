"""The statistics of a study: libraries' functions, put into the terms of `hypotheses`.

A sample is one number a seed. Arms of a pair share their seeds, and with them their source networks,
so a resample draws seeds, and every arm's numbers of a drawn seed go with it.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

Sample = NDArray[np.float64]
# Of resamples: the ends of a 95 % interval then vary by less than a hundredth of its width.
RESAMPLES = 10_000
CONFIDENCE = 0.95
# Numbers of two seeds that differ by less do not vary.
SAME = 1e-12


@dataclass(frozen=True)
class Estimate:
    """A number with its interval; `low` and `high` are the number itself where nothing varies."""

    value: float
    low: float
    high: float


def interquartile_mean(values: Sample, axis: int = -1) -> Any:
    """Mean of the middle half: robust to single seeds, and it counts more of them than the median does."""
    return stats.trim_mean(values, 0.25, axis=axis)


def bootstrap(
    samples: Sequence[Sample],
    statistic: Callable[..., Any],
    seed: int,
    resamples: int = RESAMPLES,
    confidence: float = CONFIDENCE,
) -> Estimate:
    """A statistic of one or more samples with its percentile interval over resampled seeds.

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


def unmeasured(samples: Sequence[Sample], statistic: Callable[..., Any]) -> Estimate:
    """A statistic without its interval."""
    return Estimate(float(statistic(*samples, axis=-1)), -np.inf, np.inf)


def probability_of_improvement(one: Sample, other: Sample, seed: int, resamples: int = RESAMPLES) -> Estimate:
    """How often a run of `one` does better than a run of `other`, whatever their seeds; ties count half."""

    def share(a: Sample, b: Sample, axis: int) -> Any:
        # SciPy puts resamples before the last axis.
        a, b = np.moveaxis(a, axis, -1), np.moveaxis(b, axis, -1)
        above = np.zeros(a.shape[:-1])
        for k in range(a.shape[-1]):
            gap = a[..., k : k + 1] - b
            above += ((gap > 0) + 0.5 * (gap == 0)).mean(axis=-1)
        return above / a.shape[-1]

    return bootstrap((one, other), share, seed, resamples)


def steadiness(one: Sample, other: Sample, axis: int = -1) -> Any:
    """How much less `one` varies: logarithm of the ratio of standard deviations."""
    # Resamples that do not vary at all say nothing of the ratio, but must not stop it.
    tiny = np.finfo(np.float64).tiny
    spread = [np.maximum(np.std(values, axis=axis, ddof=1), tiny) for values in (one, other)]
    return np.log(spread[1] / spread[0])


def brown_forsythe(one: Sample, other: Sample) -> float:
    """P of equal spread: an analysis of variance on distances to the median.

    1 with two seeds, which lie equally far from their median, and where nothing varies.
    """
    if min(len(one), len(other)) < 3 or (np.ptp(one) == 0 and np.ptp(other) == 0):
        return 1.0
    return float(stats.levene(one, other, center="median").pvalue)


def page_trend(samples: Sequence[Sample]) -> float:
    """P against a rise from each sample to the next, by seed (Page's L)."""
    return float(stats.page_trend_test(np.stack(samples, axis=1)).pvalue)


def log_rank(one: tuple[Sample, NDArray[np.bool_]], other: tuple[Sample, NDArray[np.bool_]]) -> float:
    """P of equal times to an event; each is times [S] and which of them were seen, not censored [S]."""
    if np.ptp(np.concatenate([one[0], other[0]])) == 0:
        return 1.0
    censored = [stats.CensoredData.right_censored(times, ~seen) for times, seen in (one, other)]
    return float(stats.logrank(*censored).pvalue)


def permutation(one: Sample, other: Sample, seed: int) -> float:
    """P of equal means of two independent samples, exact where they are small."""

    def gap(a: Sample, b: Sample, axis: int) -> Any:
        return np.mean(a, axis=axis) - np.mean(b, axis=axis)

    return float(
        stats.permutation_test(
            (one, other), gap, vectorized=True, n_resamples=RESAMPLES, rng=np.random.default_rng(seed)
        ).pvalue
    )


def slope(samples: Sequence[Sample]) -> Sample:
    """How much each seed's numbers rise from a sample to the next, by least squares: [..., S]."""
    place = np.arange(len(samples)) - (len(samples) - 1) / 2
    rise: Sample = np.tensordot(place / np.sum(place**2), np.stack(samples), axes=1)
    return rise


def no_effect(values: Sample) -> float:
    """P of a mean of zero over seeds, two-sided (Student's t): with five seeds resampling is far too sure."""
    if np.ptp(values) < SAME:
        return 1.0 if abs(values[0]) < SAME else 0.0
    return float(stats.ttest_1samp(values, 0.0).pvalue)


def below(values: Sample, margin: float) -> float:
    """P of a mean over seeds at a margin or above it, one-sided."""
    if np.ptp(values) < SAME:
        return 0.0 if values[0] < margin else 1.0
    return float(stats.ttest_1samp(values, margin, alternative="less").pvalue)


def above(values: Sample, margin: float) -> float:
    """P of a mean over seeds at a margin or below it, one-sided."""
    return below(-values, -margin)


def outside(values: Sample, margin: float) -> float:
    """P of a mean within a margin on both sides: twice the smaller of two one-sided p."""
    return min(1.0, 2 * min(above(values, margin), above(-values, margin)))


def within(values: Sample, margin: float) -> float:
    """P of a mean beyond a margin on either side: two one-sided t-tests (Schuirmann, 1987)."""
    return max(below(values, margin), below(-values, margin))


@cache
def seen_effect(seeds: int, level: float = 0.05, power: float = 0.8) -> float:
    """The least effect, in standard deviations over seeds, that a t-test finds so often.

    A t is a normal variable over a chi; SciPy's noncentral t gives no numbers for few seeds and low levels.
    """
    quantiles = (np.arange(4_000) + 0.5) / 4_000
    spread = np.sqrt(stats.chi2.ppf(quantiles, seeds - 1) / (seeds - 1))
    critical = stats.t.isf(level / 2, seeds - 1)

    def short(effect: float) -> float:
        return float(np.mean(stats.norm.sf(critical * spread - effect * np.sqrt(seeds))) - power)

    return float(optimize.brentq(short, 0.0, 1e6))


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values of a family of tests, adjusted by Holm's step-down method."""
    from statsmodels.stats.multitest import multipletests

    if not p_values:
        return []
    # It collects garbage each time, and would look through a whole study for it.
    gc.freeze()
    try:
        return [float(p) for p in multipletests(list(p_values), method="holm")[1]]
    finally:
        gc.unfreeze()
