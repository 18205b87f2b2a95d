"""The contrasts of the second study, and what they say by the rules of docs/second-study.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.gains import read_outcome
from benchmarks.questions import ARMS, FROZEN, LEARNERS, PAIRS, TRAFFIC, TRAFFIC_ARMS, TUNED_ARMS
from benchmarks.sources import IMAZU
from ship_trl.config.arm import SCRATCH
from ship_trl.files.table import Cells
from ship_trl.study.statistics import TOLERANCE, holm

Sample = NDArray[np.float64]
AGAINST_REPLAY = "less a replay of its actions"
# Two-sided error of a test, and the share of what could be gained that counts.
LEVEL, MARGIN = 0.05, 0.2


class Verdict(StrEnum):
    """What a contrast says."""

    more = "more"
    less = "less"
    equal = "equal"
    open = "open"


@dataclass(frozen=True)
class Reached:
    """What a run reached; shares of episodes that reach the goal are of its last network.

    `start` is the score before training, and `start_success` whether it reaches the goal there.
    """

    seed: int
    area: float
    start: float
    start_success: float
    end: float
    success: float
    perturbed: float
    replayed: float
    traffic: float


# By target, source, arm and learner.
Group = tuple[str, str, str, str]
Runs = dict[Group, list[Reached]]


@dataclass(frozen=True)
class Contrast:
    """A difference of two means with its 95 % interval, unadjusted, and what it says.

    `possible_gain` is NaN if that means nothing. `p` and `p_equal` are adjusted within the question; `count`
    are the runs of either side.
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
    verdict: Verdict = Verdict.open


def read_study_runs(rows: Iterable[Cells]) -> Runs:
    """Group the runs of the table; sources are left out.

    Raises:
        ValueError: a cell is wrong.
    """
    rows = list(rows)
    if not rows:
        raise ValueError("it has no rows")
    shortest = min(int(row["length"]) for row in rows)
    found: Runs = {}
    for row in rows:
        if int(row["length"]) > shortest:
            continue
        outcome = read_outcome(row)
        shares = {name: float(row[name]) for name in ("perturbed", "replayed", "traffic")}
        if not all(0 <= share <= 1 for share in shares.values()):
            raise ValueError(f"a run to {row['target']} has a share that is not from 0 to 1")
        one = Reached(
            seed=int(row["seed"]),
            area=outcome.area,
            start=outcome.jumpstart,
            start_success=float(row["reached"][0]),
            end=outcome.end,
            success=outcome.success,
            **shares,
        )
        found.setdefault((row["target"], row["source"], row["arm"], row["learner"]), []).append(one)
    return found


def metric_of(runs: Runs, target: str, source: str, arm: str, learner: str = "", *, metric: str) -> Sample:
    """Return a metric of the runs of an arm, in the order of their seeds."""
    own = sorted(runs[target, source, arm, learner], key=lambda one: one.seed)
    return np.array([getattr(one, metric) for one in own])


def scratch_of(runs: Runs, target: str, metric: str, learner: str = "") -> Sample:
    """Return a metric of the runs from scratch."""
    return metric_of(runs, target, "", SCRATCH.name, learner, metric=metric)


def unpaired(
    question: int, where: str, what: str, one: Sample, other: Sample, possible_gain: float
) -> Contrast:
    """Compare two samples by Welch's t-test."""
    margin, welch = MARGIN * possible_gain, {"equal_var": False}
    found: Any = stats.ttest_ind(one, other, **welch)
    interval = found.confidence_interval(1 - LEVEL)
    sides = (
        stats.ttest_ind(one - shift, other, alternative=side, **welch).pvalue
        for shift, side in ((margin, "less"), (-margin, "greater"))
    )
    return Contrast(
        question,
        where,
        what,
        float(one.mean() - other.mean()),
        float(interval.low),
        float(interval.high),
        possible_gain,
        float(found.pvalue),
        float(max(sides)) if np.isfinite(possible_gain) else 1.0,
        f"{len(one)}, {len(other)}",
    )


def paired(
    question: int, where: str, what: str, differences: Sample, possible_gain: float = float("nan")
) -> Contrast:
    """Test differences against zero by Student's t-test."""
    mean = float(differences.mean())
    low, high, p, p_equal = mean, mean, float(mean == 0), 1.0
    # Where all are alike no test can be made, and none is needed.
    if np.ptp(differences) > TOLERANCE:
        found: Any = stats.ttest_1samp(differences, 0.0)
        interval = found.confidence_interval(1 - LEVEL)
        low, high, p = float(interval.low), float(interval.high), float(found.pvalue)
        if np.isfinite(possible_gain):
            p_equal = max(
                float(stats.ttest_1samp(differences, shift, alternative=side).pvalue)
                for shift, side in ((MARGIN * possible_gain, "less"), (-MARGIN * possible_gain, "greater"))
            )
    return Contrast(question, where, what, mean, low, high, possible_gain, p, p_equal, f"{len(differences)}")


def transferred(runs: Runs) -> list[Contrast]:
    """Question 1: what is transferred?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        base = scratch_of(runs, target, "area")
        could = float(1 - base.mean())
        arm = {name: metric_of(runs, target, source, name, metric="area") for name in ARMS}
        found += [unpaired(1, pair, f"{name} less scratch", arm[name], base, could) for name in ARMS]
        for one, other in (("FE3", "FE3-random"), ("FTW", "FT4")):
            found.append(unpaired(1, pair, f"{one} less {other}", arm[one], arm[other], could))
    return found


def frozen_last(runs: Runs) -> list[Contrast]:
    """Question 2: does a foreign last layer cost the end?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        foreign, own = (metric_of(runs, target, one, FROZEN, metric="end") for one in (source, target))
        could = float(1 - scratch_of(runs, target, "end").mean())
        found.append(
            unpaired(2, pair, f"{FROZEN} of case {source} less that of {target}", foreign, own, could)
        )
    return found


def from_traffic(runs: Runs) -> list[Contrast]:
    """Question 3: is random traffic a source?"""
    found = []
    base = np.array([scratch_of(runs, target, "area").mean() for target in IMAZU])
    could = float(1 - base.mean())
    for arm in TRAFFIC_ARMS:
        means = np.array([metric_of(runs, target, TRAFFIC, arm, metric="area").mean() for target in IMAZU])
        found.append(paired(3, "imazu", f"{arm} less scratch", means - base, could))
    return found


def generalises(runs: Runs) -> list[Contrast]:
    """Question 4: does a network reach the goal from drawn starts more often than its own actions?

    On a pair, runs are the sample; of the problems, their means.
    """
    found = []
    for arm in (SCRATCH.name, *TUNED_ARMS):
        for pair, (source, target) in PAIRS.items():
            found.append(paired(4, pair, f"{arm} {AGAINST_REPLAY}", beyond_replay(runs, target, source, arm)))
        if is_asked(runs, 3):
            means = [beyond_replay(runs, target, TRAFFIC, arm).mean() for target in IMAZU]
            found.append(paired(4, "imazu", f"{arm} {AGAINST_REPLAY}", np.array(means)))
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
            found.append(unpaired(6, pair, words, best[arm][1], base, float(1 - base.mean())))
    return found


def choose_on_even_seeds(runs: Runs, target: str, source: str, arm: str) -> tuple[str, Sample]:
    """Return the learner that is best on even seeds, and the areas that it reaches on odd ones."""
    halves = {
        learner: [
            np.array([one.area for one in runs[target, source, arm, learner] if one.seed % 2 == odd])
            for odd in (0, 1)
        ]
        for learner in ("", *LEARNERS)
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
        verdict = Verdict.open
        if p <= LEVEL:
            verdict = Verdict.more if one.value > 0 else Verdict.less
        elif p_equal <= LEVEL:
            verdict = Verdict.equal
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
