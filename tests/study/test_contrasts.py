"""Each verdict comes out where the truth is known, and a null study gives false ones at the stated rate."""

from collections.abc import Mapping

import numpy as np
import pytest

from ship_trl.study.contrasts import Claimed, Finding, Verdict, adjust, contrast, judge, together
from ship_trl.study.statistics import Estimate, Sample, seen_effect


def arms(seed: int, means: Mapping[str, float], count: int = 15, sd: float = 0.1) -> dict[str, Sample]:
    rng = np.random.default_rng(seed)
    return {name: mean + rng.normal(0, sd, count) for name, mean in means.items()}


def measured(sd: float = 0.1, seed: int = 0, **means: float) -> Finding:
    return contrast("H", "a above b", arms(seed, means, sd=sd), {"a": 1, "b": -1}, seed)


def test_each_verdict_comes_out() -> None:
    assert measured(a=0.9, b=0.5).verdict is Verdict.supported
    assert measured(a=0.5, b=0.9).verdict is Verdict.contradicted
    assert measured(a=0.5, b=0.5, sd=0.01).verdict is Verdict.equivalent
    assert measured(a=0.5, b=0.5, sd=0.5).verdict is Verdict.inconclusive


def test_a_contrast_is_the_weighted_sum_of_interquartile_means() -> None:
    samples = arms(1, {"FE1": 0.9, "FE2": 0.2, "FE3": 0.7})
    found = contrast("H5c", "FE2 dips", samples, {"FE1": 0.5, "FE3": 0.5, "FE2": -1}, 0)
    assert found.estimate.value == pytest.approx(0.6, abs=0.1) and found.verdict is Verdict.supported
    assert found.improvement is not None and found.improvement.value == 1.0 and found.seeds == 15


@pytest.mark.parametrize(
    ("claimed", "values", "held"),
    [
        (Claimed.above, (-0.1, 0.0, 0.001), (False, False, True)),
        (Claimed.alike, (-0.06, -0.04, 0.04, 0.06), (False, True, True, False)),
        (Claimed.no_more, (-0.9, 0.04, 0.06), (True, True, False)),
    ],
)
def test_an_unsure_estimate_may_still_be_as_claimed(
    claimed: Claimed, values: tuple[float, ...], held: tuple[bool, ...]
) -> None:
    found = [
        Finding("H", "a", Estimate(v, -1, 1), None, 1, 1, 5, Verdict.inconclusive, claimed=claimed)
        for v in values
    ]
    assert tuple(finding.as_claimed for finding in found) == held


def test_a_small_difference_is_supported_before_it_is_equivalent() -> None:
    # Beyond zero and within the margin: what is measured is the difference.
    found = measured(a=0.52, b=0.5, sd=0.005)
    assert found.verdict is Verdict.supported and found.estimate.high < 0.05


def test_many_claims_need_more() -> None:
    # The same spread on both sides, and a shift of a little more than two standard errors.
    spread = np.linspace(-0.2, 0.2, 15)
    samples = {"a": 0.68 + spread, "b": 0.5 + np.roll(spread, 7)}
    one = contrast("H", "a above b", samples, {"a": 1, "b": -1}, 0)
    assert one.verdict is Verdict.supported and 0.002 < one.p < 0.05
    others = [measured(a=0.5, b=0.5, seed=k) for k in range(30, 60)]
    adjusted = adjust([one, *others])
    assert adjusted[0].adjusted > one.p and adjusted[0].verdict is Verdict.inconclusive
    assert adjust([one]) == [one] and adjust([]) == []


def test_both_intervals_must_agree() -> None:
    def verdict(improvement: Estimate, p: float) -> Verdict:
        estimate = Estimate(0.2, 0.1, 0.3)
        return judge(Finding("H", "a above b", estimate, improvement, p, p, 15, Verdict.inconclusive))

    assert verdict(Estimate(0.6, 0.45, 0.7), 0.01) is Verdict.inconclusive
    assert verdict(Estimate(0.8, 0.6, 0.9), 0.01) is Verdict.supported
    assert verdict(Estimate(0.8, 0.6, 0.9), 0.2) is Verdict.inconclusive


def test_a_claim_of_no_difference_is_supported_by_equivalence() -> None:
    def alike(sd: float, **means: float) -> Verdict:
        samples = arms(0, means, sd=sd)
        return contrast("H", "a like b", samples, {"a": 1, "b": -1}, 0, Claimed.alike).verdict

    assert alike(0.01, a=0.5, b=0.51) is Verdict.supported
    assert alike(0.05, a=0.5, b=0.8) is alike(0.05, a=0.8, b=0.5) is Verdict.contradicted
    assert alike(0.4, a=0.5, b=0.5) is alike(0.05, a=0.5, b=0.55) is Verdict.inconclusive


@pytest.mark.parametrize("count", [2, 4, 5])
def test_a_few_seeds_give_no_verdict(count: int) -> None:
    verdict = Verdict.supported if count == 5 else Verdict.inconclusive
    samples = arms(0, {"a": 0.9, "b": 0.1}, count=count, sd=0.01)
    assert contrast("H", "a above b", samples, {"a": 1, "b": -1}, 0).verdict is verdict


def test_a_claim_of_no_more_looks_to_one_side() -> None:
    def no_more(sd: float, **means: float) -> Verdict:
        samples = arms(0, means, sd=sd)
        return contrast("H", "a no more than b", samples, {"a": 1, "b": -1}, 0, Claimed.no_more).verdict

    assert no_more(0.01, a=0.5, b=0.51) is no_more(0.05, a=0.2, b=0.8) is Verdict.supported
    assert no_more(0.05, a=0.8, b=0.5) is Verdict.contradicted
    assert no_more(0.4, a=0.5, b=0.5) is Verdict.inconclusive


def test_what_could_have_been_seen_grows_with_the_figure() -> None:
    one = measured(a=0.5, b=0.5)
    first = adjust([one] * 9)[0]
    assert one.seen(0.05) == first.seen(0.05) < first.seen(0.05 / first.family)
    assert first.family == 9 and one.seen(0.05) == pytest.approx(seen_effect(15) * one.deviation)


def test_parts_of_a_claim() -> None:
    yes, no, open_ = Verdict.supported, Verdict.contradicted, Verdict.inconclusive
    assert together([yes, yes]) is yes and together([no, no]) is no and together([]) is open_
    assert together([yes, open_]) is open_ and together([yes, no, open_]) is no
    # What has no runs may still contradict, not support.
    assert together([yes], missing=1) is open_ and together([yes, no], missing=1) is no


@pytest.mark.parametrize("count", [5, 15])
def test_a_null_study_gives_false_verdicts_at_the_stated_rate(count: int) -> None:
    # Nine arms that are all like scratch: in how many studies is any of them said to differ?
    false = 0
    for study in range(100):
        names = [f"arm{k}" for k in range(9)]
        samples = arms(1000 + study, dict.fromkeys([*names, "scratch"], 0.5), count, sd=0.3)
        found = [contrast("H", name, samples, {name: 1, "scratch": -1}, study, rough=True) for name in names]
        verdicts = {finding.verdict for finding in adjust(found)}
        false += bool(verdicts & {Verdict.supported, Verdict.contradicted})
    # 5 % is stated; of 100 studies that allows eleven at most, but for one time in a hundred.
    assert false <= 11


def test_leaving_out_intervals_changes_no_verdict_of_a_difference() -> None:
    differ = {Verdict.supported, Verdict.contradicted}
    for seed in range(40):
        samples = arms(seed, {"a": 0.5 + 0.02 * (seed % 10), "b": 0.5}, 5)
        whole, rough = (
            contrast("H", "a above b", samples, {"a": 1, "b": -1}, seed, resamples=500, rough=rough)
            for rough in (False, True)
        )
        assert (whole.p, whole.estimate.value) == (rough.p, rough.estimate.value)
        assert {whole.verdict} & differ == {rough.verdict} & differ


@pytest.mark.parametrize("claimed", [Claimed.alike, Claimed.no_more])
def test_a_difference_at_the_margin_seldom_decides(claimed: Claimed) -> None:
    found = []
    for study in range(100):
        samples = arms(5000 + study, {"a": 0.55, "b": 0.5}, 5, sd=0.02)
        found.append(contrast("H", "a, b", samples, {"a": 1, "b": -1}, study, claimed, resamples=500).verdict)
    # One in twenty each way; of a hundred, ten happen once in thirty times.
    assert found.count(Verdict.supported) <= 10 and found.count(Verdict.contradicted) <= 10


def test_far_beyond_the_margin_no_difference_is_contradicted() -> None:
    samples = arms(1, {"a": 0.9, "b": 0.5}, 5, sd=0.02)
    for claimed in (Claimed.alike, Claimed.no_more):
        assert contrast("H", "a", samples, {"a": 1, "b": -1}, 0, claimed).verdict is Verdict.contradicted
    below = contrast("H", "b", samples, {"b": 1, "a": -1}, 0, Claimed.no_more)
    assert below.verdict is Verdict.supported
