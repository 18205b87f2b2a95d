"""Kinds of claim about arms, each as a test that measures it on a study; positive is as claimed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from ship_trl.study.config import NEW_CASE, RANDOM_ARM, REUSED_CASE, SELF_PAIR
from ship_trl.study.contrasts import Claimed, Finding, judged
from ship_trl.study.measured import Places, Study, levels, rises, sooner, steadier
from ship_trl.study.plan import ALONE, CONTROLS, LOW, ONE, OTHER_SOURCES, PAIRS

FE, FT = tuple(f"FE{n}" for n in range(1, 5)), tuple(f"FT{n}" for n in range(1, 5))
TRANSFERS = (*FE, *FT, "FTW")
Test = Callable[[Study, str], list[Finding]]


@dataclass(frozen=True)
class Hypothesis:
    """A claim: its name, the figure it belongs to, a sentence, and how it is measured."""

    name: str
    figure: str
    sentence: str
    tests: Sequence[Test]


def of(pair: str, *arms: str) -> Places:
    """Arms of a pair by their names."""
    return {arm: (PAIRS, pair, arm) for arm in arms}


def beats(pair: str, better: str, worse: str, metric: str = "area") -> Test:
    """One arm is better than another."""
    weights = {better: 1.0, worse: -1.0}
    what = f"{pair}: {better} above {worse}"
    return lambda study, claim: levels(study, claim, what, of(pair, better, worse), weights, metric)


def means(pair: str, better: Sequence[str], worse: Sequence[str], metric: str = "area") -> Test:
    """The mean of some arms is better than that of others."""
    weights = {arm: 1 / len(better) for arm in better} | {arm: -1 / len(worse) for arm in worse}
    what = f"{pair}: mean of {', '.join(better)} above {', '.join(worse)}"
    return lambda study, claim: levels(study, claim, what, of(pair, *weights), weights, metric)


def like_neighbours(pair: str, arm: str, neighbours: Sequence[str]) -> Test:
    """An arm does not differ from the mean of its neighbours, within the margin."""
    weights = {arm: 1.0} | {other: -1 / len(neighbours) for other in neighbours}
    what = f"{pair}: {arm} like the mean of {', '.join(neighbours)}"
    return lambda study, claim: levels(study, claim, what, of(pair, *weights), weights, "area", Claimed.alike)


def positive(pair: str, arm: str, metric: str) -> Test:
    """A metric of an arm is above zero."""
    what = f"{pair}: {arm} above zero"
    return lambda study, claim: levels(study, claim, what, of(pair, arm), {arm: 1.0}, metric)


def no_more(pair: str, arm: str, other: str, metric: str) -> Test:
    """A metric of an arm is not above that of another, but for the margin."""
    weights = {arm: 1.0, other: -1.0}
    what = f"{pair}: {arm} no more than {other}"
    return lambda study, claim: levels(
        study, claim, what, of(pair, arm, other), weights, metric, Claimed.no_more
    )


def either(*tests: Test) -> Test:
    """One of several contrasts holds: the most favourable, its p times their number.

    Of contrasts that all point the other way that is the least certain: each of them has to fail.
    """

    def best(study: Study, claim: str) -> list[Finding]:
        found = [finding for test in tests for finding in test(study, claim)]
        if len(found) < len(tests):
            return []
        first = min(found, key=lambda f: (0, f.p) if f.estimate.value > 0 else (1, -f.p))
        p = min(1.0, len(found) * first.p)
        return [judged(replace(first, what=f"{first.what} (best of {len(found)})", p=p, adjusted=p))]

    return best


def more_in(pair: str, other: str, what: str, shares: Mapping[str, float]) -> Test:
    """A weighted sum of arms is larger in one pair than in another."""
    signs = {pair: 1.0, other: -1.0}
    places = {f"{name} {arm}": (PAIRS, name, arm) for name in signs for arm in shares}
    weights = {f"{name} {arm}": sign * share for name, sign in signs.items() for arm, share in shares.items()}
    told = f"{what}: more in {pair} than in {other}"
    return lambda study, claim: levels(study, claim, told, places, weights, "area")


def interaction(pair: str, other: str, better: Sequence[str], worse: Sequence[str]) -> Test:
    """The difference of two groups of arms is larger in one pair than in another."""
    shares = {arm: 1 / len(better) for arm in better} | {arm: -1 / len(worse) for arm in worse}
    return more_in(pair, other, f"mean of {', '.join(better)} above {', '.join(worse)}", shares)


def steeper(pair: str, other: str, arms: Sequence[str]) -> Test:
    """The score's rise from the first arm to the last, by the fitted line, is larger in one pair."""
    middle, count = (len(arms) - 1) / 2, len(arms)
    steps = 12 * (count - 1) / (count**3 - count)
    shares = {arm: (k - middle) * steps for k, arm in enumerate(arms)}
    return more_in(pair, other, f"fitted rise from {arms[0]} to {arms[-1]}", shares)


def steady(pair: str, arm: str, other: str, metric: str = "area") -> Test:
    """An arm varies less over seeds."""
    return lambda study, claim: steadier(study, claim, pair, of(pair, arm, other), arm, other, metric)


def trend(pair: str, *order: str, metric: str = "area") -> Test:
    """Arms rise in this order."""
    return lambda study, claim: rises(study, claim, pair, of(pair, *order), order, metric)


def early(pair: str, arm: str, other: str) -> Test:
    """An arm reaches the threshold sooner."""
    return lambda study, claim: sooner(study, claim, pair, of(pair, arm, other), arm, other)


def at(where: str, places: Places, better: str, worse: str) -> Test:
    """One arm is better than another, wherever each lies."""
    what, compared = f"{where}: {better} above {worse}", {name: places[name] for name in (better, worse)}
    return lambda study, claim: levels(study, claim, what, compared, {better: 1.0, worse: -1.0}, "area")


SELF: Places = {"scratch": (PAIRS, "high", "scratch")} | {
    arm: (CONTROLS, SELF_PAIR, arm) for arm in (*FE, *FT)
}


def frozen_random(pair: str) -> Test:
    """FE3 is better than the same with layers that have learned nothing."""
    places = {"FE3": (PAIRS, pair, "FE3"), "FE3-random": (CONTROLS, pair, RANDOM_ARM)}
    return at(pair, places, "FE3", "FE3-random")


def reuse(part: str, case: str = REUSED_CASE) -> tuple[str, str, str]:
    """Where the runs of a reused network lie."""
    return (part, f"{case}-{NEW_CASE}", "FTW")


REUSED: Places = {
    "reused, low": reuse(LOW),
    "reused, 1": reuse(ONE),
    "scratch, low": (LOW, NEW_CASE, "scratch"),
    "scratch, 1": (ONE, NEW_CASE, "scratch"),
    # Trained alike, each on its case alone; the reused one was trained on two.
    f"case {REUSED_CASE}": reuse(ALONE),
    **{f"case {case}": reuse(LOW, case) for case in OTHER_SOURCES},
}


def some(*names: str) -> Places:
    """These of the runs on the new case."""
    return {name: REUSED[name] for name in names}


def network_effect(study: Study, claim: str) -> list[Finding]:
    """The main effect of the network in the 2 x 2 of network and starting epsilon."""
    names = ("reused, low", "reused, 1", "scratch, low", "scratch, 1")
    weights = dict(zip(names, (0.5, 0.5, -0.5, -0.5), strict=True))
    what = "new: reused above scratch, mean of both epsilons"
    return levels(study, claim, what, some(*names), weights, "area")


def confounded(study: Study, claim: str) -> list[Finding]:
    """The paper's comparison, which changes network and epsilon at once."""
    places = some("reused, low", "scratch, 1")
    return sooner(study, claim, "new", places, "reused, low", "scratch, 1")


def best_source(other: str) -> Test:
    """Case 2 is a better source than another."""
    return at("new", some("case 2", f"case {other}"), "case 2", f"case {other}")
