"""What so many seeds can see, and how many would see what there seems to be."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import optimize, stats

from ship_trl.study.analysis.statistics import FREEDOM, LEVEL, TRIMMED

# Numbers of seeds that are tried: whole blocks, and the more the coarser.
COUNTS = (*range(5, 100, 5), *range(100, 300, 20), *range(300, 1001, 100))


@cache
def seen_effect(seeds: int, level: float = LEVEL / 2, power: float = 0.8) -> float:
    """Return the least effect, in standard errors, that a one-sided t-test of so many seeds finds so often.

    A t is a normal variable over a chi; SciPy's noncentral t gives no numbers for few seeds and low levels.
    """
    freedom = FREEDOM * (seeds - 2 * int(TRIMMED * seeds) - 1)
    if freedom <= 0:
        return np.inf
    quantiles = (np.arange(4_000) + 0.5) / 4_000
    spread = np.sqrt(stats.chi2.ppf(quantiles, freedom) / freedom)
    critical = stats.t.isf(level, freedom)

    def short(effect: float) -> float:
        return float(np.mean(stats.norm.sf(critical * spread - effect)) - power)

    return float(optimize.brentq(short, 0.0, 1e9))


def seeds_needed(gap: float, error: float, seeds: int, level: float) -> int | None:
    """Return how many seeds would show a difference four times in five; None if a thousand would not.

    Args:
        gap: how far the difference is from what is to be ruled out; none shows what is not above it.
        error: the standard error of so many `seeds`; it falls with their root.
        seeds: at least two.
        level: one-sided.
    """
    # The comparison is false for what is not a number.
    shown = (n for n in COUNTS if n >= seeds and seen_effect(n, level) * error * (seeds / n) ** 0.5 <= gap)
    return next(shown, None) if gap > 0 else None
