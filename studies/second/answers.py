"""The contrasts of the second study, and what they say by the rules of README.md."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.study.statistics import LEVEL, Sample
from studies.p_values import compare, holm
from studies.second.plan import ARMS, FROZEN, IMAZU, LEARNERS, PAIRS, TRAFFIC, TRAFFIC_ARMS, TUNED_ARMS

AGAINST_REPLAY = "less a replay of its actions"
# The share of what could be gained that counts.
MARGIN = 0.2
SHARES = ("perturbed", "replayed", "traffic")
# What a contrast says.
MORE, LESS, EQUAL, OPEN = "more", "less", "equal", "open"
# By target, source, arm and learner, in the order of seeds.
Runs = dict[tuple[str, str, str, str], pd.DataFrame]
Row = dict[str, Any]


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


def metric_of(runs: Runs, target: str, source: str = "", arm: str = SCRATCH.name, metric: str = "") -> Sample:
    """Return a metric of the runs of an arm, or from scratch, in the order of their seeds; default: area."""
    return runs[target, source, arm, ""][metric or "area"].to_numpy()


def contrast(
    question: int,
    where: str,
    what: str,
    one: Sample,
    other: Sample | None = None,
    possible_gain: float = float("nan"),
) -> Row:
    """Compare two samples, or differences with zero; `possible_gain` is NaN if that means nothing."""
    found = compare(one, other, MARGIN * possible_gain)
    return {
        "question": question,
        "where": where,
        "what": what,
        "value": found.value,
        "low": found.low,
        "high": found.high,
        "possible_gain": possible_gain,
        "p": found.p,
        "p_equal": found.within,
        "count": f"{len(one)}" if other is None else f"{len(one)}, {len(other)}",
    }


def transferred(runs: Runs) -> Iterator[Row]:
    """Question 1: what is transferred?"""
    for pair, (source, target) in PAIRS.items():
        areas = {name: metric_of(runs, target, source, name) for name in ARMS}
        areas[SCRATCH.name] = base = metric_of(runs, target)
        compared = [(name, SCRATCH.name) for name in ARMS] + [("FE3", "FE3-random"), ("FTW", "FT4")]
        for one, other in compared:
            words = f"{one} less {other}"
            yield contrast(1, pair, words, areas[one], areas[other], float(1 - base.mean()))


def frozen_last(runs: Runs) -> Iterator[Row]:
    """Question 2: does a foreign last layer cost the end?"""
    for pair, (source, target) in PAIRS.items():
        foreign, own = (metric_of(runs, target, one, FROZEN, "end") for one in (source, target))
        could = float(1 - metric_of(runs, target, metric="end").mean())
        yield contrast(2, pair, f"{FROZEN} of case {source} less that of {target}", foreign, own, could)


def from_traffic(runs: Runs) -> Iterator[Row]:
    """Question 3: is random traffic a source?"""
    base = np.array([metric_of(runs, target).mean() for target in IMAZU])
    for arm in TRAFFIC_ARMS:
        means = np.array([metric_of(runs, target, TRAFFIC, arm).mean() for target in IMAZU])
        yield contrast(3, "imazu", f"{arm} less scratch", means - base, None, float(1 - base.mean()))


def generalises(runs: Runs) -> Iterator[Row]:
    """Question 4: does a network reach the goal from drawn starts more often than its own actions?

    On a pair, runs are the sample; of the problems, their means.
    """

    def gained(target: str, source: str, arm: str) -> Sample:
        place = target, "" if arm == SCRATCH.name else source, arm
        return metric_of(runs, *place, "perturbed") - metric_of(runs, *place, "replayed")

    for arm in (SCRATCH.name, *TUNED_ARMS):
        for pair, (source, target) in PAIRS.items():
            yield contrast(4, pair, f"{arm} {AGAINST_REPLAY}", gained(target, source, arm))
        if is_asked(runs, 3):
            means = [gained(target, TRAFFIC, arm).mean() for target in IMAZU]
            yield contrast(4, "imazu", f"{arm} {AGAINST_REPLAY}", np.array(means))


def tuned(runs: Runs) -> Iterator[Row]:
    """Question 6: was the learner tuned for scratch? Each arm has the best learner of its even seeds."""
    for pair, (source, target) in PAIRS.items():
        learner, base = choose_on_even_seeds(runs, target, "", SCRATCH.name)
        for arm in TUNED_ARMS:
            best, areas = choose_on_even_seeds(runs, target, source, arm)
            words = f"{arm} ({learner_label(best)}) less scratch ({learner_label(learner)})"
            yield contrast(6, pair, words, areas, base, float(1 - base.mean()))


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


QUESTIONS = {1: transferred, 2: frozen_last, 3: from_traffic, 4: generalises, 6: tuned}


def is_asked(runs: Runs, question: int) -> bool:
    """Return whether the runs of a question were made."""
    needs = {3: lambda place: place[1] == TRAFFIC, 6: lambda place: bool(place[3])}
    return question not in needs or any(map(needs[question], runs))


def answers(runs: Runs) -> pd.DataFrame:
    """Judge the questions whose runs are there: a row of each `contrast`, with its `verdict`."""
    asked = [ask for number, ask in QUESTIONS.items() if is_asked(runs, number)]
    return judge(pd.DataFrame([row for ask in asked for row in ask(runs)]))


def judge(found: pd.DataFrame) -> pd.DataFrame:
    """Adjust the p-values within each question by Holm's method, and add what each contrast says."""
    for name in ("p", "p_equal"):
        found[name] = found.groupby("question")[name].transform(lambda one: pd.Series(holm(one), one.index))
    sign = np.where(found["value"] > 0, MORE, LESS)
    says = np.select([found["p"] <= LEVEL, found["p_equal"] <= LEVEL], [sign, EQUAL], OPEN)
    return found.assign(verdict=says)
