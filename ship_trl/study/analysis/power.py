"""Power: which differences so many seeds detect, and how many seeds detect a given difference."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import optimize, stats

from ship_trl.study.analysis.statistics import FREEDOM_FACTOR, LEVEL, TRIM

# Numbers of seeds to try: whole blocks, coarser as they grow.
SEED_COUNTS = (*range(5, 100, 5), *range(100, 300, 20), *range(300, 1001, 100))


def degrees_of_freedom(seeds: int) -> float:
    """Return the degrees of freedom of an interquartile mean; 0 or less where it has no error."""
    return FREEDOM_FACTOR * (seeds - 2 * int(TRIM * seeds) - 1)


@cache
def min_detectable_effect(seeds: int, level: float = LEVEL / 2, power: float = 0.8) -> float:
    """Return the least effect, in standard errors, that a one-sided t-test detects with a given power.

    The power is a mean over quantiles of a chi distribution: SciPy's noncentral t gives no numbers for few
    seeds and low levels.
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
    """Return how many seeds detect a difference; None if a thousand do not, or the error is unknown.

    Args:
        difference: above zero.
        error: the standard error of so many `seeds`; it falls with their root.
        seeds: at least two.
        level: one-sided.
        power: above a half.
    """
    if not error > 0:
        return None
    # The root of an estimated variance is too small on average.
    error /= 1 - 1 / (4 * degrees_of_freedom(seeds))
    return next(
        (
            count
            for count in SEED_COUNTS
            if min_detectable_effect(count, level, power) * error * (seeds / count) ** 0.5 <= difference
        ),
        None,
    )
