"""The contrasts of the second study, and what they say by the rules of README.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.study.statistics import TOLERANCE, holm
from studies.second.plan import ARMS, FROZEN, IMAZU, LEARNERS, PAIRS, TRAFFIC, TRAFFIC_ARMS, TUNED_ARMS

Sample = NDArray[np.float64]
AGAINST_REPLAY = "less a replay of its actions"
# Two-sided error of a test, and the share of what could be gained that counts.
LEVEL, MARGIN = 0.05, 0.2
SHARES = ("perturbed", "replayed", "traffic")
# What a contrast says.
MORE, LESS, EQUAL, OPEN = VERDICTS = ("more", "less", "equal", "open")
# By target, source, arm and learner, in the order of seeds.
Runs = dict[tuple[str, str, str, str], pd.DataFrame]


@dataclass(frozen=True)
class Contrast:
    """A difference of two means with its 95 % interval, unadjusted, and what it says.

    `possible_gain` is NaN if that means nothing. `p` and `p_equal` are adjusted within the question; `count`
    are the runs of either side. `verdict` is one of `VERDICTS`.
    """

    question: int
    where: str
    what: str
    value: float
    low: float
    high: float
    possible_gain: float
    p: float
    p_equal: float
    count: str
    verdict: str = OPEN


def group_runs(table: pd.DataFrame) -> Runs:
    """Group the runs of the table; sources, which are longer, are left out.

    Raises:
        ConfigError: runs were not tested elsewhere, or a share is wrong.
    """
    if missing := [name for name in ("learner", *SHARES) if name not in table]:
        raise ConfigError(f"answers: it is no table of tested runs: it has no column {missing[0]!r}")
    if not table[list(SHARES)].apply(lambda one: one.between(0, 1)).all(axis=None):
        raise ConfigError("answers: a run has a share that is not from 0 to 1")
    runs = table[table["length"] == table["length"].min()].sort_values("seed", kind="stable")
    runs = runs.assign(start_success=runs["reached"].str[0].astype(float))
    return dict(iter(runs.groupby(["target", "source", "arm", "learner"])))


def metric_of(runs: Runs, target: str, source: str, arm: str, learner: str = "", *, metric: str) -> Sample:
    """Return a metric of the runs of an arm, in the order of their seeds."""
    return runs[target, source, arm, learner][metric].to_numpy()


def scratch_of(runs: Runs, target: str, metric: str) -> Sample:
    """Return a metric of the runs from scratch."""
    return metric_of(runs, target, "", SCRATCH.name, metric=metric)


def compare(
    question: int,
    where: str,
    what: str,
    one: Sample,
    other: Sample | None = None,
    possible_gain: float = float("nan"),
) -> Contrast:
    """Compare two samples by Welch's t-test, or differences with zero by Student's."""

    def test(shift: float = 0.0, side: str = "two-sided") -> Any:
        if other is None:
            return stats.ttest_1samp(one, shift, alternative=side)
        return stats.ttest_ind(one - shift, other, alternative=side, equal_var=False)

    value = float(one.mean() - (0.0 if other is None else other.mean()))
    low, high, p, p_equal = value, value, float(value == 0), 1.0
    # Where all differences are alike no test can be made, and none is needed.
    if other is not None or np.ptp(one) > TOLERANCE:
        found, margin = test(), MARGIN * possible_gain
        low, high = map(float, found.confidence_interval(1 - LEVEL))
        p = float(found.pvalue)
        if np.isfinite(possible_gain):
            p_equal = float(max(test(margin, "less").pvalue, test(-margin, "greater").pvalue))
    count = f"{len(one)}" if other is None else f"{len(one)}, {len(other)}"
    return Contrast(question, where, what, value, low, high, possible_gain, p, p_equal, count)


def transferred(runs: Runs) -> list[Contrast]:
    """Question 1: what is transferred?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        base = scratch_of(runs, target, "area")
        could = float(1 - base.mean())
        arm = {name: metric_of(runs, target, source, name, metric="area") for name in ARMS}
        found += [compare(1, pair, f"{name} less scratch", arm[name], base, could) for name in ARMS]
        for one, other in (("FE3", "FE3-random"), ("FTW", "FT4")):
            found.append(compare(1, pair, f"{one} less {other}", arm[one], arm[other], could))
    return found


def frozen_last(runs: Runs) -> list[Contrast]:
    """Question 2: does a foreign last layer cost the end?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        foreign, own = (metric_of(runs, target, one, FROZEN, metric="end") for one in (source, target))
        could = float(1 - scratch_of(runs, target, "end").mean())
        found.append(
            compare(2, pair, f"{FROZEN} of case {source} less that of {target}", foreign, own, could)
        )
    return found


def from_traffic(runs: Runs) -> list[Contrast]:
    """Question 3: is random traffic a source?"""
    found = []
    base = np.array([scratch_of(runs, target, "area").mean() for target in IMAZU])
    could = float(1 - base.mean())
    for arm in TRAFFIC_ARMS:
        means = np.array([metric_of(runs, target, TRAFFIC, arm, metric="area").mean() for target in IMAZU])
        found.append(compare(3, "imazu", f"{arm} less scratch", means - base, None, could))
    return found


def generalises(runs: Runs) -> list[Contrast]:
    """Question 4: does a network reach the goal from drawn starts more often than its own actions?

    On a pair, runs are the sample; of the problems, their means.
    """
    found = []
    for arm in (SCRATCH.name, *TUNED_ARMS):
        for pair, (source, target) in PAIRS.items():
            gained = beyond_replay(runs, target, source, arm)
            found.append(compare(4, pair, f"{arm} {AGAINST_REPLAY}", gained))
        if is_asked(runs, 3):
            means = [beyond_replay(runs, target, TRAFFIC, arm).mean() for target in IMAZU]
            found.append(compare(4, "imazu", f"{arm} {AGAINST_REPLAY}", np.array(means)))
    return found


def beyond_replay(runs: Runs, target: str, source: str, arm: str) -> Sample:
    """Return each run's success from drawn starts, less that of a replay of its actions."""
    source = "" if arm == SCRATCH.name else source
    own, replayed = (metric_of(runs, target, source, arm, metric=name) for name in ("perturbed", "replayed"))
    return own - replayed


def tuned(runs: Runs) -> list[Contrast]:
    """Question 6: was the learner tuned for scratch? Each arm has the best learner of its even seeds."""
    found = []
    for pair, (source, target) in PAIRS.items():
        best = {
            arm: choose_on_even_seeds(runs, target, "" if arm == SCRATCH.name else source, arm)
            for arm in (SCRATCH.name, *TUNED_ARMS)
        }
        learner, base = best[SCRATCH.name]
        for arm in TUNED_ARMS:
            words = f"{arm} ({learner_label(best[arm][0])}) less scratch ({learner_label(learner)})"
            found.append(compare(6, pair, words, best[arm][1], base, float(1 - base.mean())))
    return found


def choose_on_even_seeds(runs: Runs, target: str, source: str, arm: str) -> tuple[str, Sample]:
    """Return the learner that is best on even seeds, and the areas that it reaches on odd ones."""
    halves = {
        learner: [own.loc[own["seed"] % 2 == odd, "area"].to_numpy() for odd in (0, 1)]
        for learner in ("", *LEARNERS)
        for own in [runs[target, source, arm, learner]]
    }
    best = max(halves, key=lambda learner: float(halves[learner][0].mean()))
    return best, halves[best][1]


def learner_label(learner: str) -> str:
    """Name a learner by its values."""
    return ", ".join(word.split("=")[1] for word in learner.split()) or "the study's"


QUESTIONS: dict[int, Callable[[Runs], list[Contrast]]] = {
    1: transferred,
    2: frozen_last,
    3: from_traffic,
    4: generalises,
    6: tuned,
}


def judge(contrasts: Sequence[Contrast]) -> list[Contrast]:
    """Adjust the p-values of a question by Holm's method, and say what each contrast says."""
    adjusted = zip(
        contrasts,
        holm([one.p for one in contrasts]),
        holm([one.p_equal for one in contrasts]),
        strict=True,
    )
    found = []
    for one, p, p_equal in adjusted:
        verdict = OPEN
        if p <= LEVEL:
            verdict = MORE if one.value > 0 else LESS
        elif p_equal <= LEVEL:
            verdict = EQUAL
        found.append(replace(one, p=p, p_equal=p_equal, verdict=verdict))
    return found


def answers(runs: Runs) -> list[Contrast]:
    """Judge the questions whose runs are there."""
    found: list[Contrast] = []
    for number, ask in QUESTIONS.items():
        if is_asked(runs, number):
            found += judge(ask(runs))
    return found


def is_asked(runs: Runs, question: int) -> bool:
    """Return whether the runs of a question were made."""
    needs = {3: lambda place: place[1] == TRAFFIC, 6: lambda place: bool(place[3])}
    return question not in needs or any(map(needs[question], runs))
