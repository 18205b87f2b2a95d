"""Verdicts by the rules of the plan, on studies whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from ship_trl.study.claims.hypotheses import OURS
from ship_trl.study.claims.kinds import Hypothesis, beats, no_more, steady
from ship_trl.study.claims.verdicts import answer, explore, judge
from ship_trl.study.compare import Claimed, Verdict, contrast
from ship_trl.study.manifest import Manifest
from ship_trl.study.statistics import look_level
from ship_trl.study.study import Study
from tests.study.synthetic import make_study, told


def high(**ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", "high", arm): end for arm, end in ends.items()}


def claim(name: str, *pairs: tuple[str, str]) -> Hypothesis:
    return Hypothesis(name, "5", "", [beats("high", better, worse) for better, worse in pairs])


def test_a_conjunction_is_supported_at_its_largest_p_with_nothing_adjusted_inside() -> None:
    study = make_study(high(FE1=0.9, FE2=0.7, FE3=0.6))
    both = claim("A", ("FE1", "FE2"), ("FE2", "FE3"))
    (found,) = judge(study, [both], 15, 0.025)
    assert found.verdict is Verdict.supported and found.p == max(f.p for f in found.findings)
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
    assert found.findings[1].adjusted == pytest.approx(2 * found.findings[1].against)


def test_one_open_contrast_leaves_a_claim_open() -> None:
    study = make_study(high(FE1=0.9, FE2=0.7, FE3=0.7), sd=0.2)
    (found,) = judge(study, [claim("A", ("FE1", "FE2"), ("FE2", "FE3"))], 15, 0.025)
    assert found.verdict is Verdict.inconclusive


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
        (found,) = judge(study, [Hypothesis("A", "5", "", tests)], 15, 0.025)
        return found.verdict

    assert verdict("FE1", "FE2") is verdict("FE1", "FE3") is Verdict.supported
    assert verdict("FE3", "FE1") is Verdict.contradicted


def test_looks_follow_the_plan_and_not_what_is_there() -> None:
    study = make_study(high(FE1=0.62, FE2=0.6), seeds=5, sd=0.01)
    five = answer(study, [claim("A", ("FE1", "FE2"))])[0]
    planned = replace(study, plan=Manifest(tuple(range(15))))
    assert study.looks == (5,) and planned.looks == (5, 10, 15)
    first = answer(planned, [claim("A", ("FE1", "FE2"))])[0]
    # The first of three looks is stricter, and a second that is not whole decides nothing.
    assert five.findings[0].estimate.low > first.findings[0].estimate.low
    assert first.verdict is Verdict.inconclusive


def test_what_a_look_decided_is_what_is_told_while_the_next_is_under_way() -> None:
    study = replace(make_study(high(FE1=0.9, FE2=0.3, FE3=0.3), 7, sd=0.002), plan=Manifest(tuple(range(15))))
    sure, none = answer(study, [claim("A", ("FE1", "FE2")), claim("B", ("FE2", "FE3"))])
    assert (sure.verdict, sure.decided, sure.missing) == (Verdict.supported, 5, 0)
    assert sure.findings[0].seeds == 5 and sure.level < 0.001
    # Of the other one too: seeds of a look that is not whole are not looked at.
    assert none.verdict is Verdict.inconclusive
    assert (none.seeds, none.missing, none.findings[0].seeds) == (5, 0, 5)


def test_what_stays_open_at_the_last_look_is_told_of_that_look() -> None:
    study = replace(make_study(high(FE1=0.9, FE2=0.3, FE3=0.3), 12, sd=0.1), plan=Manifest(tuple(range(15))))
    for seeds, look in ((5, 5), (6, 5), (9, 5), (10, 10), (12, 10)):
        (found,) = answer(study.first(seeds, study.level), [claim("B", ("FE2", "FE3"))])
        assert (found.verdict, found.seeds, found.missing) == (Verdict.inconclusive, look, 0)
        assert found.level == look_level(look // 5, 3) and found.findings[0].seeds == look
    # Before the first look there is nothing else to tell of.
    (found,) = answer(study.first(4, study.level), [claim("B", ("FE2", "FE3"))])
    assert (found.seeds, found.missing, found.findings[0].seeds) == (5, 1, 4)


def test_seeds_that_come_later_undo_no_decision() -> None:
    places = high(FE1=0.9, FE2=0.3, FE3=0.32, FT1=0.3)
    claims = [claim(f"{a}{b}", (a, b)) for a in ("FE1", "FE3") for b in ("FE2", "FT1")]
    whole = replace(make_study(places, 20, sd=0.004), plan=Manifest(tuple(range(15))))
    assert whole.looks == (5, 10, 15)
    decided: dict[str, tuple[Verdict, int]] = {}
    for count in range(5, 21):
        kept = {key: record for key, record in whole.records.items() if key[3] < count}
        for found in answer(replace(whole, records=kept), claims):
            if found.hypothesis.name in decided:
                assert (found.verdict, found.decided) == decided[found.hypothesis.name]
            elif found.decided:
                decided[found.hypothesis.name] = (found.verdict, found.decided)
    assert len(decided) >= 2


def test_what_has_no_runs_counts_in_the_family_of_contradictions() -> None:
    study = make_study(high(FE1=0.6, FE2=0.9))
    lacking = claim("A", ("FE1", "FE2"), *(("FE1", f"FT{n}") for n in range(1, 5)))
    (found,) = judge(study, [lacking], 15, 0.025)
    assert found.missing == 4 and found.findings[0].adjusted == pytest.approx(5 * found.findings[0].against)


def test_times_of_arms_that_do_not_get_there_are_not_alike() -> None:
    study = make_study(high(FE1=0.55, FE2=0.3))
    tests = [beats("high", "FE1", "FE2", "time")]
    (found,) = judge(study, [Hypothesis("A", "5", "", tests)], 15, 0.025)
    assert found.verdict is Verdict.inconclusive and found.findings[0].within == 1.0


@pytest.mark.parametrize("seeds", [2, 4])
def test_a_few_seeds_give_no_verdict(seeds: int) -> None:
    (found,) = answer(make_study(high(FE1=0.9, FE2=0.1), seeds, sd=0.001), [claim("A", ("FE1", "FE2"))])
    assert found.verdict is Verdict.inconclusive and found.findings


def test_spread_is_judged_along_the_curve() -> None:
    study = make_study(high(FE1=0.6), sd=0.01)
    study.records.update(make_study(high(FT1=0.6), sd=0.2).records)
    tests = {"yes": [steady("high", "FE1", "FT1")], "no": [steady("high", "FT1", "FE1")]}
    found = {n: judge(study, [Hypothesis(n, "5", "", t)], 15, 0.025)[0].verdict for n, t in tests.items()}
    assert found == {"yes": Verdict.supported, "no": Verdict.contradicted}


def test_between_looks_nothing_is_judged() -> None:
    # Of fifteen seeds twelve have runs.
    ends = {("pairs", "low", "scratch"): 0.5, ("controls", "self4", "FTW"): 0.9}
    study = replace(make_study(ends, seeds=12), plan=Manifest(tuple(range(15))))
    assert study.whole_looks == (5, 10)
    own = {found.hypothesis.name: found for found in explore(study)}["E4"]
    assert {finding.seeds for finding in own.findings} == {10}
    assert study.first(7, 0.025).whole_looks == study.first(3, 0.025).whole_looks == (5,)


def test_our_own_contrasts_are_judged_alone_on_what_seeds_they_have() -> None:
    places = {("controls", "self", "FTW"): 0.9, ("pairs", "high", "scratch"): 0.5}
    places |= {("controls", label, "FTW"): 0.9 for label in ("self4", "self6")}
    places |= {("pairs", pair, "scratch"): 0.5 for pair in ("low", "lowest")}
    study: Study = make_study(places)
    for key in [key for key in study.records if key[0] == "controls" and key[3] >= 5]:
        del study.records[key]
    found = {a.hypothesis.name: a for a in explore(study)}
    assert [a.hypothesis for a in explore(study)] == OURS
    assert found["E4"].verdict is Verdict.supported and found["E4"].decided == 5
    assert found["E1"].verdict is Verdict.inconclusive and not found["E1"].findings


def simulated(values: np.ndarray, claimed: Claimed = Claimed.above) -> Hypothesis:
    """A claim of one contrast, with these differences by seed and a margin of 0.5."""
    return Hypothesis("A", "5", "", [lambda study: [contrast("", "area", values, 0.5, claimed)]])


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
