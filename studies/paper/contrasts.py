"""The kinds of contrasts that claims consist of, and how each is tested."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ship_trl.study.compare import SEED, Contrast, comparative, joined, mean_difference, weighted
from ship_trl.study.metrics import TIMES, curve, has_reached
from ship_trl.study.plan import CONTROLS, NEW_CASE, PAIRS, REUSED, SCRATCH, SCRATCH_PAIR, Places, control_arm
from ship_trl.study.statistics import LEVEL, TOLERANCE, Estimate, Sample, standard_error
from ship_trl.study.study import Study
from studies.p_values import p_above, p_below

SPREAD = "spread"
# Times can be equivalent only if at least this share of each arm's runs reaches the threshold.
MIN_REACHED = 0.75
# The case that each control pair transfers to itself.
SELF_CASES = {"self": "2", "self4": "4", "self6": "6"}
# All permutations of 12 seeds. The smallest p times the contrasts of a figure must allow a decision.
MAX_PERMUTATIONS = 2**12
# Permutations at a time, so that their curves stay in the processor's cache.
BLOCK = 64
TINY = float(np.finfo(np.float64).tiny)


class Claimed(StrEnum):
    """What a claim says about a contrast."""

    above = "above zero"
    no_more = "not above the margin"


@dataclass(frozen=True)
class Levels:
    """A contrast of levels, and what a claim says of it."""

    contrast: Contrast
    claimed: Claimed = Claimed.above

    def measure(self, study: Study, permutations: int = MAX_PERMUTATIONS) -> Estimate | None:
        """Measure it with its p-values; None for fewer than two common seeds."""
        found, metric = self.contrast.measure(study), self.contrast.metric
        if found is None:
            return None
        runs = study.matched(self.contrast.places)
        share = study.claims.margin
        possible = study.claims.possible_gain(next(iter(runs.values()))[0].target, metric)
        # Times of runs that never reach the threshold are equal without being alike.
        shares = (np.mean([*map(has_reached, arm)]) for arm in runs.values())
        is_cut = metric in TIMES and min(shares) < MIN_REACHED
        margin = None if is_cut or possible is None or share is None else share * possible
        return add_p_values(found, self.claimed, margin)


@dataclass(frozen=True)
class Spread:
    """The claim that the curves of an arm of a pair vary less over seeds than another's."""

    pair: str
    steady: str
    other: str
    claimed: Claimed = Claimed.above

    def measure(self, study: Study, permutations: int = MAX_PERMUTATIONS) -> Estimate | None:
        """Measure the logarithm of the ratio of spreads, by so many permutations at most."""
        runs = study.matched(of(self.pair, self.steady, self.other))
        if min(map(len, runs.values())) < 2:
            return None
        one, two = (np.stack([curve(record) for record in runs[name]]) for name in (self.steady, self.other))
        found, p, against = spread_test(one, two, SEED, study.level, permutations)
        what = f"{self.pair}: {self.steady} varies less than {self.other} ({SPREAD}; logarithm of the ratio)"
        return replace(found, what=what, metric=SPREAD, p=p, against=against, seeds=len(one))


Test = Levels | Spread


def add_p_values(found: Estimate, claimed: Claimed, margin: float | None) -> Estimate:
    """Add margin and p-values of a measured difference."""
    values = np.array(found.differences)
    p, against = 1.0, 1.0
    if claimed is Claimed.above:
        p, against = p_above(values), p_below(values)
    elif margin is not None:
        p, against = p_below(values, margin), p_above(values, margin)
    within = 1.0 if margin is None else p_within(values, margin)
    return replace(found, p=p, against=against, margin=margin, within=within)


def p_within(values: Sample, margin: float) -> float:
    """Return the p-value against a mean beyond the margin: two one-sided tests (Schuirmann, 1987).

    It is 1 if nothing varies: then all runs are cut off at the same bound, which shows nothing.
    """
    if standard_error(values)[0] < TOLERANCE:
        return 1.0
    return max(p_below(values, margin), p_above(values, -margin))


def of(pair: str, *arms: str) -> Places:
    """Return the places of a pair's arms, by arm."""
    return {arm: (PAIRS, pair, arm) for arm in arms}


def compare(
    where: str,
    places: Places,
    better: Sequence[str],
    worse: Sequence[str],
    metric: str = "area",
    what: str = "",
    claimed: Claimed = Claimed.above,
) -> Test:
    """Test that the mean of some arms is better than the mean of others; `places` says where they lie."""
    words = what or f"{joined(better)} {comparative(metric)} {joined(worse)}"
    return Levels(weighted(where, words, places, mean_difference(better, worse), metric), claimed)


def means(pair: str, better: Sequence[str], worse: Sequence[str], metric: str = "area") -> Test:
    """Test that the mean of some arms of a pair is better than the mean of others."""
    return compare(pair, of(pair, *better, *worse), better, worse, metric)


def beats(pair: str, better: str, worse: str, metric: str = "area") -> Test:
    """Test that one arm of a pair is better than another."""
    return means(pair, (better,), (worse,), metric)


def each_beats(pair: str, better: Sequence[str], worse: Sequence[str], *metrics: str) -> list[Test]:
    """Test that each of some arms is better than each of others, in each metric."""
    return [beats(pair, one, other, metric) for metric in metrics for one in better for other in worse]


def no_more(pair: str, arms: Sequence[str], others: Sequence[str], metric: str = "area") -> Test:
    """Test that the mean of some arms is above the mean of others by less than the margin."""
    what = f"{joined(arms)} no more than {joined(others)}"
    return compare(pair, of(pair, *arms, *others), arms, others, metric, what, Claimed.no_more)


def rises(pair: str, *order: str) -> Test:
    """Test that the area of arms rises in this order: the rise of a fitted line from first to last."""
    middle, count = (len(order) - 1) / 2, len(order)
    steps = 12 * (count - 1) / (count**3 - count)
    weights = {arm: (k - middle) * steps for k, arm in enumerate(order)}
    return Levels(weighted(pair, f"rise over {', '.join(order)}", of(pair, *order), weights, "area"))


def control(pair: str, arm: str, kind: str) -> Test:
    """Test that an arm is better than its control."""
    other = control_arm(arm, kind)
    places = {arm: (PAIRS, pair, arm), other: (CONTROLS, pair, other)}
    return compare(pair, places, (arm,), (other,))


def itself(label: str, better: str, worse: str) -> Test:
    """Test that an arm of a case's transfer to itself is better than another arm of it, or than scratch."""
    places: Places = {arm: (CONTROLS, label, arm) for arm in (better, worse)}
    places = {**places, SCRATCH: (PAIRS, SCRATCH_PAIR[label], SCRATCH)}
    return compare(f"{SELF_CASES[label]} to {SELF_CASES[label]}", places, (better,), (worse,))


def self_dips(label: str) -> list[Test]:
    """Test that a case's transfer to itself has the dips of pair high too."""
    return [
        *(itself(label, better, "FE2") for better in (SCRATCH, "FE1", "FE3")),
        *(itself(label, better, "FT1") for better in (SCRATCH, "FT2")),
    ]


def network_effect(metric: str) -> Test:
    """Test the main effect of the network in the 2 x 2 of network and starting epsilon."""
    reused, scratch = ("reused, low", "reused, 1"), ("scratch, low", "scratch, 1")
    return compare(NEW_CASE, REUSED, reused, scratch, metric, "reused above scratch, mean of both epsilons")


def interaction(metric: str) -> Test:
    """Test whether the effect of the network is larger with the low starting epsilon."""
    weights = {"reused, low": 1.0, "reused, 1": -1.0, "scratch, low": -1.0, "scratch, 1": 1.0}
    what = "reused above scratch, more with the low epsilon"
    return Levels(weighted(NEW_CASE, what, REUSED, weights, metric))


def by_path(arm: str, metric: str) -> Test:
    """Test that a source with the target's path is better than one with the target's ship."""
    path, ship = "same path (1 to 2)", "same ship (ship to 2)"
    places = {path: (PAIRS, "high", arm), ship: (CONTROLS, "ship", arm)}
    return compare(arm, places, (path,), (ship,), metric)


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
        logarithms: Sample = np.log(np.maximum(spreads[1], TINY) / np.maximum(spreads[0], TINY))
        return logarithms

    change, change_squared = two - one, two**2 - one**2
    totals, squares = (one + two).sum(axis=0), (one**2 + two**2).sum(axis=0)
    exchanged, exchanged_square = swaps @ change, swaps @ change_squared
    found, errors = np.empty(len(swaps)), np.empty(len(swaps))
    for block in (slice(start, start + BLOCK) for start in range(0, len(swaps), BLOCK)):
        total = one.sum(axis=0) + exchanged[block]
        square = (one**2).sum(axis=0) + exchanged_square[block]
        left_out = np.empty((seeds, len(total)))
        for k in range(seeds):
            mine, mine_squared = (
                values[k] + swaps[block, k : k + 1] * by
                for values, by in ((one, change[k]), (one**2, change_squared[k]))
            )
            first = total - mine, square - mine_squared
            second = (
                totals - total - (one[k] + two[k] - mine),
                squares - square - (one[k] ** 2 + two[k] ** 2 - mine_squared),
            )
            left_out[k] = ratio(first, second, seeds - 1)
        deviations = ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
        errors[block] = np.sqrt((seeds - 1) / seeds * deviations)
        found[block] = ratio((total, square), (totals - total, squares - square), seeds)
    return found, errors
