"""Kinds of claim about arms, each as a test that measures it on a study; positive is as claimed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ship_trl.study.analysis.contrasts import Claimed, Finding
from ship_trl.study.analysis.measured import levels, steadier
from ship_trl.study.analysis.metrics import METRICS, TIMES
from ship_trl.study.analysis.study import Places, Study
from ship_trl.study.plan.config import NEW_CASE, REUSED_CASE, SELF_PAIR, names
from ship_trl.study.plan.jobs import ALONE, CONTROLS, FURTHER_SOURCES, LOW, ONE, OTHER_SOURCES, PAIRS

ARMS = names("arm")
FE, FT = tuple(f"FE{n}" for n in range(1, 5)), tuple(f"FT{n}" for n in range(1, 5))
TRANSFERS = (*FE, *FT, "FTW")
Test = Callable[[Study, str], list[Finding]]


@dataclass(frozen=True)
class Hypothesis:
    """A claim: its name, the figure whose claims it is judged with, a sentence, and its contrasts.

    It is a conjunction: all its contrasts must hold.
    """

    name: str
    figure: str
    sentence: str
    tests: Sequence[Test]


def of(pair: str, *arms: str) -> Places:
    """Return arms of a pair by their names."""
    return {arm: (PAIRS, pair, arm) for arm in arms}


def joined(arms: Sequence[str]) -> str:
    """Name some arms as one side of a contrast."""
    return arms[0] if len(arms) == 1 else f"mean of {', '.join(arms)}"


def weighted(
    where: str,
    what: str,
    places: Places,
    weights: Mapping[str, float],
    metric: str,
    claimed: Claimed = Claimed.above,
) -> Test:
    """Test a weighted sum of arms; of times the smaller is the better, so that they change sign.

    Raises:
        ValueError: there is no such metric or arm.
    """
    if metric not in METRICS:
        raise ValueError(f"{where}, {what}: no metric {metric}; allowed: {', '.join(METRICS)}")
    for _, _, arm in places.values():
        if arm not in ARMS:
            raise ValueError(f"{where}, {what}: no arm {arm}; allowed: {', '.join(ARMS)}")
    sign = -1.0 if metric in TIMES else 1.0
    signed = {name: sign * weight for name, weight in weights.items()}
    told = f"{where}: {what}"
    return lambda study, claim: levels(study, claim, told, places, signed, metric, claimed)


def at(where: str, places: Places, better: str, worse: str, metric: str = "area") -> Test:
    """Test that one arm is better than another (sooner, where the metric is a time), wherever they lie."""
    word = "sooner than" if metric in TIMES else "above"
    compared = {name: places[name] for name in (better, worse)}
    return weighted(where, f"{better} {word} {worse}", compared, {better: 1.0, worse: -1.0}, metric)


def beats(pair: str, better: str, worse: str, metric: str = "area") -> Test:
    """Test that one arm of a pair is better than another."""
    return at(pair, of(pair, better, worse), better, worse, metric)


def sooner(pair: str, first: str, second: str) -> Test:
    """Test that one arm of a pair reaches the threshold sooner than another."""
    return beats(pair, first, second, "time")


def means(pair: str, better: Sequence[str], worse: Sequence[str], metric: str = "area") -> Test:
    """Test that the mean of some arms is better than that of others."""
    weights = {arm: 1 / len(better) for arm in better} | {arm: -1 / len(worse) for arm in worse}
    word = "sooner than" if metric in TIMES else "above"
    what = f"{joined(better)} {word} {joined(worse)}"
    return weighted(pair, what, of(pair, *weights), weights, metric)


def no_more(pair: str, arms: Sequence[str], others: Sequence[str], metric: str = "area") -> Test:
    """Test that the mean of some arms is not above that of others, but for the margin."""
    weights = {arm: 1 / len(arms) for arm in arms} | {arm: -1 / len(others) for arm in others}
    what = f"{joined(arms)} no more than {joined(others)}"
    return weighted(pair, what, of(pair, *weights), weights, metric, Claimed.no_more)


def rises(pair: str, *order: str, metric: str = "area") -> Test:
    """Test that arms rise in this order: the fitted line's rise from the first to the last."""
    middle, count = (len(order) - 1) / 2, len(order)
    steps = 12 * (count - 1) / (count**3 - count)
    weights = {arm: (k - middle) * steps for k, arm in enumerate(order)}
    return weighted(pair, f"rise over {', '.join(order)}", of(pair, *order), weights, metric)


def each_above_the_last(pair: str, *order: str, metric: str = "area") -> list[Test]:
    """Test that each arm is better than the one before it."""
    return [beats(pair, better, worse, metric) for worse, better in pairwise(order)]


def steady(pair: str, arm: str, other: str) -> Test:
    """Test that an arm varies less over seeds than another."""
    return lambda study, claim: steadier(study, claim, pair, of(pair, arm, other), arm, other)


def control(pair: str, arm: str, kind: str, metric: str = "area") -> Test:
    """Test that an arm is better than the same with frozen layers that hold no features."""
    other = f"{arm}-{kind}"
    return at(pair, {arm: (PAIRS, pair, arm), other: (CONTROLS, pair, other)}, arm, other, metric)


def itself(case: str, scratch_pair: str, label: str, better: str, worse: str) -> Test:
    """Test that one arm of a case's transfer to itself is better than another of it, or than scratch."""
    places = {
        arm: (PAIRS, scratch_pair, arm) if arm == "scratch" else (CONTROLS, label, arm)
        for arm in (better, worse)
    }
    return at(f"{case} to {case}", places, better, worse)


def self_dips(case: str = "2", pair: str = "high", label: str = SELF_PAIR) -> list[Test]:
    """Test that the dips of pair high are there from a case to itself too."""
    return [
        *(itself(case, pair, label, better, "FE2") for better in ("scratch", "FE1", "FE3")),
        *(itself(case, pair, label, better, "FT1") for better in ("scratch", "FT2")),
    ]


def reuse(part: str, case: str = REUSED_CASE) -> tuple[str, str, str]:
    """Return where the runs of a reused network lie."""
    return (part, f"{case}-{NEW_CASE}", "FTW")


REUSED: Places = {
    "reused, low": reuse(LOW),
    "reused, 1": reuse(ONE),
    "scratch, low": (LOW, NEW_CASE, "scratch"),
    "scratch, 1": (ONE, NEW_CASE, "scratch"),
    # Trained alike, each on its case alone; the reused one was trained on two.
    f"case {REUSED_CASE}": reuse(ALONE),
    **{f"case {case}": reuse(LOW, case) for case in (*OTHER_SOURCES, *FURTHER_SOURCES)},
}


def network_effect(metric: str) -> Test:
    """Test the main effect of the network in the 2 x 2 of network and starting epsilon."""
    weights = {"reused, low": 0.5, "reused, 1": 0.5, "scratch, low": -0.5, "scratch, 1": -0.5}
    return two_by_two("reused above scratch, mean of both epsilons", weights, metric)


def interaction(metric: str) -> Test:
    """Test whether the network's effect is larger with the low starting epsilon."""
    weights = {"reused, low": 1.0, "reused, 1": -1.0, "scratch, low": -1.0, "scratch, 1": 1.0}
    return two_by_two("reused above scratch, more with the low epsilon", weights, metric)


def two_by_two(what: str, weights: Mapping[str, float], metric: str) -> Test:
    """Test a weighted sum of the 2 x 2."""
    return weighted("new", what, {name: REUSED[name] for name in weights}, weights, metric)


def confounded(metric: str) -> Test:
    """Test the paper's comparison, which changes network and epsilon at once."""
    return at("new", REUSED, "reused, low", "scratch, 1", metric)


def best_source(other: str) -> Test:
    """Test that case 2 is a better source than another."""
    return at("new", REUSED, f"case {REUSED_CASE}", f"case {other}")


def by_path(arm: str, metric: str) -> Test:
    """Test that a source with the target's path is better than one with the target's ship."""
    path, ship = "same path (1 to 2)", "same ship (ship to 2)"
    places = {path: (PAIRS, "high", arm), ship: (CONTROLS, "ship", arm)}
    return at(arm, places, path, ship, metric)
