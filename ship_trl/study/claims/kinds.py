"""The kinds of contrasts that claims consist of. Each returns a test that measures itself on a study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ship_trl.study.compare import Claimed, Finding, measure_levels, measure_spread
from ship_trl.study.metrics import METRICS, TIMES
from ship_trl.study.plan import CONTROLS, NEW_CASE, PAIRS, SCRATCH, SCRATCH_PAIR, control_arm
from ship_trl.study.study import REUSED, Places, Study

Test = Callable[[Study], list[Finding]]
# The case that each control pair transfers to itself.
SELF_CASES = {"self": "2", "self4": "4", "self6": "6"}


@dataclass(frozen=True)
class Hypothesis:
    """A claim, judged with those of its figure; it holds if all its contrasts hold."""

    name: str
    figure: str
    sentence: str
    tests: Sequence[Test]


def of(pair: str, *arms: str) -> Places:
    """Return the places of a pair's arms, by arm."""
    return {arm: (PAIRS, pair, arm) for arm in arms}


def joined(arms: Sequence[str]) -> str:
    """Name some arms as one side of a contrast."""
    return arms[0] if len(arms) == 1 else f"mean of {', '.join(arms)}"


def mean_difference(better: Sequence[str], worse: Sequence[str]) -> dict[str, float]:
    """Return the weights of the mean of some arms less the mean of others."""
    weights = dict.fromkeys(better, 1 / len(better))
    for arm in worse:
        weights[arm] = weights.get(arm, 0.0) - 1 / len(worse)
    return weights


def comparative(metric: str) -> str:
    """Return the word for the better side of a contrast."""
    return "sooner than" if metric in TIMES else "above"


def weighted(
    where: str,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    claimed: Claimed = Claimed.above,
) -> Test:
    """Test a weighted sum of arms, with the opposite sign for times, where less is better."""
    if metric not in METRICS:
        raise ValueError(f"{where}, {what}: no metric {metric}; allowed: {', '.join(METRICS)}")
    sign = -1.0 if metric in TIMES else 1.0
    signed = {name: sign * weight for name, weight in weights.items()}
    compared, words = {name: places[name] for name in weights}, f"{where}: {what}"
    return lambda study: measure_levels(study, words, compared, signed, metric, claimed)


def compare(
    where: str, places: Places, better: Sequence[str], worse: Sequence[str], metric: str = "area"
) -> Test:
    """Test that the mean of some arms is better than the mean of others; `places` says where they lie."""
    what = f"{joined(better)} {comparative(metric)} {joined(worse)}"
    return weighted(where, what, places, mean_difference(better, worse), metric)


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
    weights = mean_difference(arms, others)
    what = f"{joined(arms)} no more than {joined(others)}"
    return weighted(pair, what, of(pair, *weights), weights, metric, Claimed.no_more)


def rises(pair: str, *order: str) -> Test:
    """Test that the area of arms rises in this order: the rise of a fitted line from first to last."""
    middle, count = (len(order) - 1) / 2, len(order)
    steps = 12 * (count - 1) / (count**3 - count)
    weights = {arm: (k - middle) * steps for k, arm in enumerate(order)}
    return weighted(pair, f"rise over {', '.join(order)}", of(pair, *order), weights, "area")


def steady(pair: str, arm: str, other: str) -> Test:
    """Test that an arm varies less over seeds than another."""
    return lambda study: measure_spread(study, pair, of(pair, arm, other), arm, other)


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
    weights = mean_difference(("reused, low", "reused, 1"), ("scratch, low", "scratch, 1"))
    return weighted(NEW_CASE, "reused above scratch, mean of both epsilons", REUSED, weights, metric)


def interaction(metric: str) -> Test:
    """Test whether the effect of the network is larger with the low starting epsilon."""
    weights = {"reused, low": 1.0, "reused, 1": -1.0, "scratch, low": -1.0, "scratch, 1": 1.0}
    return weighted(NEW_CASE, "reused above scratch, more with the low epsilon", REUSED, weights, metric)


def by_path(arm: str, metric: str) -> Test:
    """Test that a source with the target's path is better than one with the target's ship."""
    path, ship = "same path (1 to 2)", "same ship (ship to 2)"
    places = {path: (PAIRS, "high", arm), ship: (CONTROLS, "ship", arm)}
    return compare(arm, places, (path,), (ship,), metric)
