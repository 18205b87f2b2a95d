"""Claims on spread, dips, early episodes and controls point the way that the paper's words do."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ship_trl.study.analysis.contrasts import Verdict
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.verdicts import answer, explore
from ship_trl.study.plan.arms import FE, FT, TRANSFERS
from tests.study.synthetic import make_record, returns_of

EPISODES, ANNEALED = 200, 120
TARGETS = {"high": "2", "low": "4", "lowest": "6"}
Shape = Callable[[np.random.Generator], NDArray[np.float64]]
Places = Mapping[tuple[str, str, str], Shape]


def flat(level: float, sd: float = 0.003) -> Shape:
    """A run at one level, which seeds share up to `sd`."""
    return lambda rng: np.full(EPISODES, level) + rng.normal(0, sd)


def rising(end: float) -> Shape:
    """A run that rises from nothing."""
    return lambda rng: end * np.minimum(1, np.arange(EPISODES) / 100) + rng.normal(0, 0.003)


def dipping(level: float, trough: float, end: float) -> Shape:
    """A run that falls when exploration ends, and then ends higher."""

    def draw(rng: np.random.Generator) -> NDArray[np.float64]:
        scores = np.full(EPISODES, level)
        scores[ANNEALED : ANNEALED + 20], scores[ANNEALED + 20 :] = trough, end
        return scores + rng.normal(0, 0.003)

    return draw


def study(places: Places, starts: Mapping[str, float] | None = None) -> Study:
    """Fifteen seeds of each place; `starts` are greedy scores before training, by arm."""
    records = {}
    epsilon = np.maximum(0.0001, 1 - np.arange(EPISODES) / ANNEALED)
    for k, ((part, pair, arm), shape) in enumerate(places.items()):
        for seed in range(15):
            rng = np.random.default_rng([k, seed])
            record = make_record(shape(rng), part, pair, arm, seed)
            level = (starts or {}).get(arm, 0.0)
            record = replace(
                record,
                target=TARGETS.get(pair, "2"),
                training=replace(record.training, epsilon=epsilon),
                draws=returns_of(level + rng.normal(0, 0.01, 5)),
            )
            records[part, pair, arm, seed] = record
    return Study(records)


def verdict(name: str, places: Places, starts: Mapping[str, float] | None = None) -> Verdict:
    """What is said of a claim."""
    made = study(places, starts)
    return next(a.verdict for a in [*answer(made), *explore(made)] if a.hypothesis.name == name)


def pair(name: str, shapes: Mapping[str, Shape]) -> Places:
    """Arms of a pair."""
    return {("pairs", name, arm): shape for arm, shape in shapes.items()}


def test_c5_is_better_early_and_ends_lower() -> None:
    quick, slow = flat(0.8), rising(0.95)
    yes = {k: v for name in TARGETS for k, v in pair(name, {"FTW": quick, "FT4": slow}).items()}
    no = {k: v for name in TARGETS for k, v in pair(name, {"FTW": slow, "FT4": quick}).items()}
    assert verdict("C5", yes) is Verdict.supported and verdict("C5", no) is Verdict.contradicted


def test_h5b_is_steadier() -> None:
    def places(arms: float, scratch: float) -> Places:
        return pair("high", {arm: flat(0.7, arms) for arm in TRANSFERS} | {"scratch": flat(0.7, scratch)})

    assert verdict("H5b", places(0.01, 0.2)) is Verdict.supported
    assert verdict("H5b", places(0.2, 0.01)) is Verdict.contradicted


@pytest.mark.parametrize(
    ("middle", "said"), [(0.7, Verdict.supported), (0.9, Verdict.supported), (0.5, Verdict.contradicted)]
)
def test_h6b_has_no_dips(middle: float, said: Verdict) -> None:
    shapes = {arm: flat(0.7, 0.0005) for arm in ("FE1", "FE3", "FT2")}
    assert verdict("H6b", pair("low", shapes | {arm: flat(middle, 0.0005) for arm in ("FE2", "FT1")})) is said


def test_h6c_is_higher_and_steadier() -> None:
    def places(better: tuple[str, ...], worse: tuple[str, ...]) -> Places:
        shapes = {arm: flat(0.8, 0.005) for arm in better} | {arm: flat(0.5, 0.1) for arm in worse}
        return pair("low", shapes)

    assert verdict("H6c", places(FT, FE)) is Verdict.supported
    assert verdict("H6c", places(FE, FT)) is Verdict.contradicted


def test_h6e_is_best_at_the_beginning() -> None:
    others = ("scratch", *FE, *FT)
    yes = pair("low", {"FTW": flat(0.8)} | dict.fromkeys(others, rising(0.9)))
    no = pair("low", {"FTW": rising(0.9)} | dict.fromkeys(others, flat(0.8)))
    assert verdict("H6e", yes, {"FTW": 0.6}) is Verdict.supported
    assert verdict("H6e", no, dict.fromkeys(others, 0.6)) is Verdict.contradicted


def test_h7e_and_h7f_fall_when_exploration_ends() -> None:
    dips, holds = dipping(0.8, 0.3, 0.9), flat(0.8)
    yes = pair("lowest", dict.fromkeys(FT, dips) | {"FTW": holds, "scratch": holds})
    no = pair("lowest", dict.fromkeys(FT, flat(0.6)) | {"FTW": dips, "scratch": holds})
    for name in ("H7e", "H7f"):
        assert verdict(name, yes) is Verdict.supported and verdict(name, no) is Verdict.contradicted


@pytest.mark.parametrize(("name", "kind"), [("E1", "random"), ("E2", "permuted")])
def test_controls_are_worse_than_what_has_learned(name: str, kind: str) -> None:
    def places(learned: float, control: float) -> Places:
        found = {("pairs", pair, arm): flat(learned) for pair in TARGETS for arm in FE}
        return found | {("controls", pair, f"{arm}-{kind}"): flat(control) for pair in TARGETS for arm in FE}

    assert verdict(name, places(0.8, 0.5)) is Verdict.supported
    assert verdict(name, places(0.5, 0.8)) is Verdict.contradicted


def test_the_gain_of_reuse_depends_on_how_much_is_explored() -> None:
    def places(low: float, one: float) -> Places:
        return {
            ("reuse/epsilon_low", "2-new", "FTW"): rising(low),
            ("reuse/epsilon_1", "2-new", "FTW"): rising(one),
            ("reuse/epsilon_low", "new", "scratch"): rising(0.7),
            ("reuse/epsilon_1", "new", "scratch"): rising(0.7),
        }

    assert verdict("E5", places(0.99, 0.75)) is Verdict.supported
    assert verdict("E5", places(0.75, 0.99)) is Verdict.contradicted
