"""The contrasts of the second study, and what they say by the rules of docs/second-study.md."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.questions import ARMS, FROZEN, LEARNERS, PAIRS, TRAFFIC, TRAFFIC_ARMS, TUNED_ARMS
from benchmarks.sources import IMAZU
from ship_trl.config.arm import SCRATCH
from ship_trl.files.table import Cells
from ship_trl.sources.gains import read_outcome
from ship_trl.study.analysis.statistics import TOLERANCE, holm

Sample = NDArray[np.float64]
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
    """What a run reached; shares of episodes that reach the goal are of its last network."""

    seed: int
    area: float
    start: float
    end: float
    success: float
    perturbed: float
    replayed: float
    traffic: float


# By target, source, arm and learner.
Place = tuple[str, str, str, str]
Runs = dict[Place, list[Reached]]


@dataclass(frozen=True)
class Contrast:
    """A difference of two means with its 95 % interval, unadjusted, and what it says.

    `could` is what could be gained, NaN if that means nothing. `p` and `p_equal` are adjusted within the
    question; `count` are the runs of either side.
    """

    question: int
    where: str
    what: str
    value: float
    low: float
    high: float
    could: float
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
    shortest = min(int(row["length"]) for row in rows)
    found: Runs = {}
    for row in rows:
        if int(row["length"]) > shortest:
            continue
        outcome = read_outcome(row)
        shares = (float(row[name]) for name in ("perturbed", "replayed", "traffic"))
        one = Reached(
            int(row["seed"]), outcome.area, outcome.jumpstart, outcome.end, outcome.success, *shares
        )
        found.setdefault((row["target"], row["source"], row["arm"], row["learner"]), []).append(one)
    return found


def of(runs: Runs, target: str, source: str, arm: str, metric: str, learner: str = "") -> Sample:
    """Return a metric of the runs of an arm, in the order of their seeds."""
    own = sorted(runs.get((target, source, arm, learner), ()), key=lambda one: one.seed)
    return np.array([getattr(one, metric) for one in own])


def scratch_of(runs: Runs, target: str, metric: str, learner: str = "") -> Sample:
    """Return a metric of the runs from scratch."""
    return of(runs, target, "", SCRATCH.name, metric, learner)


def unpaired(question: int, where: str, what: str, one: Sample, other: Sample, could: float) -> Contrast:
    """Compare two samples by Welch's t-test."""
    margin, welch = MARGIN * could, {"equal_var": False}
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
        could,
        float(found.pvalue),
        float(max(sides)) if np.isfinite(could) else 1.0,
        f"{len(one)}, {len(other)}",
    )


def paired(
    question: int, where: str, what: str, differences: Sample, could: float = float("nan")
) -> Contrast:
    """Test differences against zero by Student's t-test."""
    mean = float(differences.mean())
    low, high, p, p_equal = mean, mean, float(mean == 0), 1.0
    # Where all are alike no test can be made, and none is needed.
    if np.ptp(differences) > TOLERANCE:
        found: Any = stats.ttest_1samp(differences, 0.0)
        interval = found.confidence_interval(1 - LEVEL)
        low, high, p = float(interval.low), float(interval.high), float(found.pvalue)
        if np.isfinite(could):
            p_equal = max(
                float(stats.ttest_1samp(differences, shift, alternative=side).pvalue)
                for shift, side in ((MARGIN * could, "less"), (-MARGIN * could, "greater"))
            )
    return Contrast(question, where, what, mean, low, high, could, p, p_equal, f"{len(differences)}")


def transferred(runs: Runs) -> list[Contrast]:
    """Question 1: what is transferred?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        base = scratch_of(runs, target, "area")
        could = float(1 - base.mean())
        arm = {name: of(runs, target, source, name, "area") for name in ARMS}
        found += [unpaired(1, pair, f"{name} less scratch", arm[name], base, could) for name in ARMS]
        for one, other in (("FE3", "FE3-random"), ("FTW", "FT4")):
            found.append(unpaired(1, pair, f"{one} less {other}", arm[one], arm[other], could))
    return found


def frozen_last(runs: Runs) -> list[Contrast]:
    """Question 2: does a foreign last layer cost the end?"""
    found = []
    for pair, (source, target) in PAIRS.items():
        foreign, own = (of(runs, target, one, FROZEN, "end") for one in (source, target))
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
        means = np.array([of(runs, target, TRAFFIC, arm, "area").mean() for target in IMAZU])
        found.append(paired(3, "imazu", f"{arm} less scratch", means - base, could))
    return found


def generalises(runs: Runs) -> list[Contrast]:
    """Question 4: does a network reach the goal from drawn starts more often than its own actions?"""
    found = []
    for arm in (SCRATCH.name, *TUNED_ARMS):
        groups = {pair: [(target, source)] for pair, (source, target) in PAIRS.items()}
        groups["imazu"] = [(target, TRAFFIC) for target in IMAZU]
        for where, places in groups.items():
            differences = [
                of(runs, target, "" if arm == SCRATCH.name else source, arm, "perturbed")
                - of(runs, target, "" if arm == SCRATCH.name else source, arm, "replayed")
                for target, source in places
            ]
            found.append(paired(4, where, f"{arm} less a replay of its actions", np.concatenate(differences)))
    return found


def tuned(runs: Runs) -> list[Contrast]:
    """Question 6: was the learner tuned for scratch? Each arm has the best learner of its even seeds."""
    found = []
    for pair, (source, target) in PAIRS.items():
        best = {
            arm: best_half(runs, target, "" if arm == SCRATCH.name else source, arm)
            for arm in (SCRATCH.name, *TUNED_ARMS)
        }
        learner, base = best[SCRATCH.name]
        for arm in TUNED_ARMS:
            words = f"{arm} ({short(best[arm][0])}) less scratch ({short(learner)})"
            found.append(unpaired(6, pair, words, best[arm][1], base, float(1 - base.mean())))
    return found


def best_half(runs: Runs, target: str, source: str, arm: str) -> tuple[str, Sample]:
    """Return the learner that is best on even seeds, and the areas that it reaches on odd ones."""
    areas = {learner: of(runs, target, source, arm, "area", learner) for learner in ("", *LEARNERS)}
    best = max(areas, key=lambda learner: float(areas[learner][::2].mean()))
    return best, areas[best][1::2]


def short(learner: str) -> str:
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
