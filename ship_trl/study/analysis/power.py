"""Which differences so many seeds show, and how many seeds show a given difference."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import optimize, stats

from ship_trl.study.analysis.statistics import FREEDOM, LEVEL, TRIMMED

# Numbers of seeds that are tried: whole blocks, and the more the coarser.
COUNTS = (*range(5, 100, 5), *range(100, 300, 20), *range(300, 1001, 100))


def freedom_of(seeds: int) -> float:
    """Return the degrees of freedom of a trimmed mean of so many seeds, at most 0 where it has no error."""
    return FREEDOM * (seeds - 2 * int(TRIMMED * seeds) - 1)


@cache
def seen_effect(seeds: int, level: float = LEVEL / 2, power: float = 0.8) -> float:
    """Return the least effect, in standard errors, that a one-sided t-test of so many seeds finds so often.

    A t is a normal variable over a chi; SciPy's noncentral t gives no numbers for few seeds and low levels.
    """
    freedom = freedom_of(seeds)
    if freedom <= 0:
        return np.inf
    quantiles = (np.arange(4_000) + 0.5) / 4_000
    spread = np.sqrt(stats.chi2.ppf(quantiles, freedom) / freedom)
    critical = stats.t.isf(level, freedom)

    def short(effect: float) -> float:
        return float(np.mean(stats.norm.sf(critical * spread - effect)) - power)

    return float(optimize.brentq(short, 0.0, 1e9))


def seeds_needed(difference: float, error: float, seeds: int, level: float, power: float) -> int | None:
    """Return how many seeds show a difference so often; None if a thousand do not, or no error is known.

    Args:
        difference: above zero.
        error: the standard error of so many `seeds`; it falls with their root.
        seeds: at least two.
        level: one-sided.
        power: how often, above a half.
    """
    if not error > 0:
        return None
    # The root of an estimated variance is too small on average: a chi over the root of its freedom.
    error /= 1 - 1 / (4 * freedom_of(seeds))
    found = (n for n in COUNTS if seen_effect(n, level, power) * error * (seeds / n) ** 0.5 <= difference)
    return next(found, None)
