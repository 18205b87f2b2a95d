"""Tests of the studies: p-values of interquartile means, and comparisons of means with a margin."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan
from typing import Any

import numpy as np
from scipy import special, stats

from ship_trl.study.statistics import (
    CONFIDENCE,
    TOLERANCE,
    Estimate,
    Sample,
    interquartile_mean,
    standard_error,
)


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


def compare(one: Sample, other: Sample | None = None, margin: float = nan) -> Estimate:
    """Compare the means of two independent samples by Welch's t-test, or differences with zero by Student's.

    `p` is two-sided; `within` tests for a mean within the margin, and is 1 where that is NaN.
    """

    def test(shift: float = 0.0, side: str = "two-sided") -> Any:
        if other is None:
            return stats.ttest_1samp(one, shift, alternative=side)
        return stats.ttest_ind(one - shift, other, alternative=side, equal_var=False)

    value = float(one.mean() - (0.0 if other is None else other.mean()))
    # Where all differences are alike no test can be made, and none is needed.
    if other is None and np.ptp(one) <= TOLERANCE:
        return Estimate(value, value, value, p=float(value == 0))
    found, within = test(), 1.0
    low, high = map(float, found.confidence_interval(CONFIDENCE))
    if isfinite(margin):
        within = float(max(test(margin, "less").pvalue, test(-margin, "greater").pvalue))
    return Estimate(value, low, high, p=float(found.pvalue), within=within)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values of a family of tests, adjusted by Holm's step-down method."""
    p = np.array(p_values, np.float64)
    order = np.argsort(p)
    factors = np.arange(len(p), 0, -1)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * factors), 1.0)
    return [float(value) for value in adjusted]
