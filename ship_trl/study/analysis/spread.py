"""A permutation test of how much curves vary over seeds."""

from __future__ import annotations

import numpy as np

from ship_trl.study.analysis.statistics import LEVEL, TOLERANCE, Estimate, Sample

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
