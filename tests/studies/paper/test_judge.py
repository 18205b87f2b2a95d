"""Verdicts by the rules of the plan, on studies whose truth is known."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from ship_trl.study.manifest import NO_PLAN
from ship_trl.study.statistics import FREEDOM_FACTOR, Estimate, estimate_mean, standard_error
from ship_trl.study.study import Study
from studies.p_values import p_above
from studies.paper.claims import OURS
from studies.paper.contrasts import Claimed, Levels, Spread, add_p_values, beats, no_more
from studies.paper.judge import (
    Claim,
    Verdict,
    explore,
    judge,
    judge_all,
    look_level,
    min_detectable_effect,
    seeds_needed,
)
from tests.study.synthetic import make_study, told

FIFTEEN = replace(NO_PLAN, judged=[*range(15)])


def high(**ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", "high", arm): end for arm, end in ends.items()}


def claim(name: str, *pairs: tuple[str, str]) -> Claim:
    return Claim(name, "5", "", [beats("high", better, worse) for better, worse in pairs])


def test_a_conjunction_is_supported_at_its_largest_p_with_nothing_adjusted_inside() -> None:
    study = make_study(high(FE1=0.9, FE2=0.7, FE3=0.6))
    both = claim("A", ("FE1", "FE2"), ("FE2", "FE3"))
    (found,) = judge(study, [both], 15, 0.025)
    assert found.verdict is Verdict.supported and found.p == max(f.found.p for f in found.findings)
    # Holm's method is over claims: with nine others the same p counts tenfold.
    others = [claim(f"B{k}", ("FE3", "FE1")) for k in range(9)]
    crowded, *_ = judge(study, [both, *others], 15, 0.025)
    assert crowded.p == pytest.approx(10 * found.p) and crowded.claims == 10


def test_one_contrast_the_other_way_contradicts_and_is_adjusted_over_all() -> None:
    study = make_study(high(FE1=0.9, FE2=0.7, FE3=0.6))
    mixed = claim("A", ("FE1", "FE2"), ("FE3", "FE2"))
    (found,) = judge(study, [mixed], 15, 0.025)
    assert found.verdict is Verdict.contradicted
    assert [f.verdict for f in found.findings] == [Verdict.supported, Verdict.contradicted]
    assert found.findings[1].adjusted == pytest.approx(2 * found.findings[1].found.against)


def test_an_open_claim_says_how_many_seeds_would_decide_it() -> None:
    def wanted(*pairs: tuple[str, str], **ends: float) -> int | None:
        (found,) = judge(make_study(high(**ends), sd=0.2), [claim("A", *pairs)], 15, 0.025)
        assert found.verdict is Verdict.inconclusive
        return found.seeds_wanted()

    one = wanted(("FE1", "FE2"), FE1=0.8, FE2=0.7)
    assert one is not None and one > 15
    # What was estimated does not count, and all contrasts together take more than one.
    assert wanted(("FE1", "FE2"), FE1=0.75, FE2=0.7) == one
    both = wanted(("FE1", "FE2"), ("FE1", "FE3"), FE1=0.8, FE2=0.7, FE3=0.3)
    assert both is not None and both > one
    (decided,) = judge(make_study(high(FE1=0.9, FE2=0.3)), [claim("A", ("FE1", "FE2"))], 15, 0.025)
    assert decided.seeds_wanted() is None


def test_differences_within_the_margin_are_equivalent() -> None:
    study = make_study(high(FE1=0.7, FE2=0.7, FE3=0.701), sd=0.004)
    (found,) = judge(study, [claim("A", ("FE1", "FE2"), ("FE2", "FE3"))], 15, 0.025)
    assert found.verdict is Verdict.equivalent
    # What could be gained on a case of one's own is not known, and so nothing is.
    own = {key: told(record, target="mine") for key, record in study.records.items()}
    (found,) = judge(replace(study, records=own), [claim("A", ("FE1", "FE2"))], 15, 0.025)
    assert found.verdict is Verdict.inconclusive


def test_a_claim_of_no_more_is_supported_within_the_margin() -> None:
    study = make_study(high(FE1=0.7, FE2=0.7, FE3=0.95), sd=0.004)

    def verdict(arm: str, other: str) -> Verdict:
        tests = [no_more("high", (arm,), (other,))]
        (found,) = judge(study, [Claim("A", "5", "", tests)], 15, 0.025)
        return found.verdict

    assert verdict("FE1", "FE2") is verdict("FE1", "FE3") is Verdict.supported
    assert verdict("FE3", "FE1") is Verdict.contradicted


def test_looks_follow_the_plan_and_not_what_is_there() -> None:
    study = make_study(high(FE1=0.62, FE2=0.6), seeds=5, sd=0.01)
    five = judge_all(study, [claim("A", ("FE1", "FE2"))])[0]
    planned = replace(study, plan=FIFTEEN)
    assert study.looks == (5,) and planned.looks == (5, 10, 15)
    first = judge_all(planned, [claim("A", ("FE1", "FE2"))])[0]
    # The first of three looks is stricter, and a second that is not whole decides nothing.
    assert five.findings[0].found.low > first.findings[0].found.low
    assert first.verdict is Verdict.inconclusive


def test_what_a_look_decided_is_what_is_told_while_the_next_is_under_way() -> None:
    study = replace(make_study(high(FE1=0.9, FE2=0.3, FE3=0.3), 7, sd=0.002), plan=FIFTEEN)
    sure, none = judge_all(study, [claim("A", ("FE1", "FE2")), claim("B", ("FE2", "FE3"))])
    assert (sure.verdict, sure.decided, sure.missing) == (Verdict.supported, 5, 0)
    assert sure.findings[0].found.seeds == 5 and sure.level < 0.001
    # Of the other one too: seeds of a look that is not whole are not looked at.
    assert none.verdict is Verdict.inconclusive
    assert (none.seeds, none.missing, none.findings[0].found.seeds) == (5, 0, 5)


def test_seeds_that_come_later_undo_no_decision() -> None:
    places = high(FE1=0.9, FE2=0.3, FE3=0.32, FT1=0.3)
    claims = [claim(f"{a}{b}", (a, b)) for a in ("FE1", "FE3") for b in ("FE2", "FT1")]
    whole = replace(make_study(places, 20, sd=0.004), plan=FIFTEEN)
    assert whole.looks == (5, 10, 15)
    decided: dict[str, tuple[Verdict, int]] = {}
    for count in range(5, 21):
        kept = {key: record for key, record in whole.records.items() if key[3] < count}
        for found in judge_all(replace(whole, records=kept), claims):
            if found.claim.name in decided:
                assert (found.verdict, found.decided) == decided[found.claim.name]
            elif found.decided:
                decided[found.claim.name] = (found.verdict, found.decided)
    assert len(decided) >= 2


def test_what_has_no_runs_counts_in_the_family_of_contradictions() -> None:
    study = make_study(high(FE1=0.6, FE2=0.9))
    lacking = claim("A", ("FE1", "FE2"), *(("FE1", f"FT{n}") for n in range(1, 5)))
    (found,) = judge(study, [lacking], 15, 0.025)
    assert found.missing == 4 and found.findings[0].adjusted == pytest.approx(
        5 * found.findings[0].found.against
    )


@pytest.mark.parametrize("seeds", [2, 4])
def test_a_few_seeds_give_no_verdict(seeds: int) -> None:
    (found,) = judge_all(make_study(high(FE1=0.9, FE2=0.1), seeds, sd=0.001), [claim("A", ("FE1", "FE2"))])
    assert found.verdict is Verdict.inconclusive and found.findings


def test_spread_is_judged_along_the_curve() -> None:
    study = make_study(high(FE1=0.6), sd=0.01)
    study.records.update(make_study(high(FT1=0.6), sd=0.2).records)
    tests = {"yes": [Spread("high", "FE1", "FT1")], "no": [Spread("high", "FT1", "FE1")]}
    found = {n: judge(study, [Claim(n, "5", "", t)], 15, 0.025)[0].verdict for n, t in tests.items()}
    assert found == {"yes": Verdict.supported, "no": Verdict.contradicted}


def test_our_own_contrasts_are_judged_alone_on_what_seeds_they_have() -> None:
    places = {("controls", "self", "FTW"): 0.9, ("pairs", "high", "scratch"): 0.5}
    places |= {("controls", label, "FTW"): 0.9 for label in ("self4", "self6")}
    places |= {("pairs", pair, "scratch"): 0.5 for pair in ("low", "lowest")}
    study: Study = make_study(places)
    for key in [key for key in study.records if key[0] == "controls" and key[3] >= 5]:
        del study.records[key]
    found = {a.claim.name: a for a in explore(study, OURS)}
    assert [a.claim for a in explore(study, OURS)] == OURS
    assert found["E4"].verdict is Verdict.supported and found["E4"].decided == 5
    assert found["E1"].verdict is Verdict.inconclusive and not found["E1"].findings


@dataclass(frozen=True)
class Known(Levels):
    """A contrast of which the measurement is given."""

    contrast: Any
    claimed: Claimed = Claimed.above

    def measure(self, study: Study, permutations: int = 0) -> Estimate:
        found: Estimate = self.contrast
        return found


def simulated(values: np.ndarray, claimed: Claimed = Claimed.above) -> Claim:
    """A claim of one contrast, with these differences by seed and a margin of 0.5."""
    found = replace(estimate_mean(values), differences=tuple(values.tolist()))
    return Claim("A", "5", "", [Known(add_p_values(found, claimed, 0.5), claimed)])


def test_arms_like_scratch_are_seldom_decided_at_any_look() -> None:
    # Claims of a figure share scratch; 5 % of the figures may have one that is decided.
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(100):
        differences = rng.normal(0, 1, (11, 15)) - rng.normal(0, 1, 15)
        looks = (
            judge(Study({}), [simulated(row[:count]) for row in differences], count, look_level(look, 3))
            for look, count in enumerate((5, 10, 15), 1)
        )
        decided = {answer.verdict for answers in looks for answer in answers}
        wrong += bool(decided & {Verdict.supported, Verdict.contradicted})
    assert wrong / 100 <= 0.05 + 3 * (0.05 * 0.95 / 100) ** 0.5


def test_differences_at_the_margin_are_seldom_called_none() -> None:
    rng = np.random.default_rng(1)
    found = {Claimed.above: 0, Claimed.no_more: 0}
    for _ in range(600):
        values = rng.normal(0.5, 0.2, 15)
        for claimed in found:
            (answer,) = judge(Study({}), [simulated(values, claimed)], 15, 0.025)
            wrong = Verdict.equivalent if claimed is Claimed.above else Verdict.supported
            found[claimed] += answer.verdict is wrong
    assert max(found.values()) / 600 <= 0.025 + 3 * (0.025 * 0.975 / 600) ** 0.5


def test_what_so_many_seeds_could_see() -> None:
    # By hand: the power of a t-test is that of a noncentral t beyond its critical value.
    effect, freedom = min_detectable_effect(15), FREEDOM_FACTOR * (15 - 2 * 3 - 1)
    assert stats.nct.sf(stats.t.isf(0.025, freedom), freedom, effect) == pytest.approx(0.8, abs=1e-4)
    assert min_detectable_effect(2) > min_detectable_effect(5) > min_detectable_effect(6) > effect
    assert min_detectable_effect(15, 0.001) > effect and min_detectable_effect(1) == np.inf


def standard_error_of_15() -> float:
    """Return the standard error of 15 normal seeds, as it is on average."""
    rng = np.random.default_rng(0)
    return float(np.mean([standard_error(rng.normal(0, 1, 15))[0] for _ in range(2_000)]))


def test_so_many_seeds_as_are_needed_show_a_difference_as_often_as_is_asked() -> None:
    rng = np.random.default_rng(1)
    error = standard_error_of_15()
    for power in (0.8, 0.95):
        needed = seeds_needed(0.5, error, 15, 0.025, power)
        assert needed is not None and 30 <= needed <= 90
        shown = np.mean([p_above(rng.normal(0.5, 1, needed)) <= 0.025 for _ in range(1_000)])
        assert power - 0.03 < shown < power + 0.07


@pytest.mark.parametrize("looks", [1, 2, 3, 5])
def test_looks_together_err_as_often_as_one(looks: int) -> None:
    rng = np.random.default_rng(looks)
    steps = rng.normal(size=(200_000, looks)).cumsum(axis=1) / np.sqrt(np.arange(1, looks + 1))
    bounds = stats.norm.isf([look_level(k, looks) for k in range(1, looks + 1)])
    assert np.mean((steps > bounds).any(axis=1)) == pytest.approx(0.025, abs=0.0015)
    assert all(np.diff(bounds) < 0)
