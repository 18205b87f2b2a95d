"""A permutation test of how much curves vary over seeds."""

from __future__ import annotations

import numpy as np

from ship_trl.study.analysis.statistics import LEVEL, TOLERANCE, Estimate, Sample

# Permutations of a spread test: all of 12 seeds. The smallest p times a figure's contrasts must allow a
# decision.
MAX_PERMUTATIONS = 2**12


def spread_test(
    steady: Sample,
    other: Sample,
    seed: int,
    level: float = LEVEL / 2,
    permutations: int = MAX_PERMUTATIONS,
) -> tuple[Estimate, float, float]:
    """Test by permutation whether one arm's curves vary less over seeds than another's.

    An arm's spread is the standard deviation over seeds, averaged along the curve. The statistic is the
    logarithm of the ratio of two spreads, divided by its jackknife error, so that it also holds for arms
    whose seeds vary in different ways (Janssen, 1997). Curves are deviations from their arm's mean curve, so
    levels do not count. A permutation exchanges the two arms of some seeds; few seeds have all permutations.

    Args:
        steady: curves of the arm that should vary less, [S, T].
        other: curves of the other arm, [S, T].
        seed: of the random permutations.
        level: one-sided, left out at each end of the interval.
        permutations: how many at most.

    Returns:
        The logarithm with the interval of the same permutations, and the one-sided p-values against `steady`
        varying at least as much, and at most as much.
    """
    one, two = (curves - curves.mean(axis=0) for curves in (steady, other))
    seeds = len(one)
    if seeds < 3 or max(np.abs(one).max(), np.abs(two).max()) < TOLERANCE:
        return Estimate(log_spread_ratio(one, two), -np.inf, np.inf), 1.0, 1.0
    if 2**seeds <= permutations:
        swaps = (np.arange(2**seeds)[:, None] >> np.arange(seeds)) & 1
    else:
        swaps = np.random.default_rng(seed).integers(0, 2, (permutations, seeds))
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
    tiny = np.finfo(np.float64).tiny
    spreads = [max(float(np.std(curves, axis=0, ddof=1).mean()), tiny) for curves in (one, two)]
    return float(np.log(spreads[1] / spreads[0]))


def jackknife(one: Sample, two: Sample, swaps: Sample) -> tuple[Sample, Sample]:
    """Return log ratios of spreads and their jackknife errors, [P] each.

    Args:
        one: curves of an arm, [S, T], with a mean curve of zero.
        two: curves of the other arm, alike.
        swaps: permutations, [P, S]; 1 where the arms of a seed are exchanged.
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
