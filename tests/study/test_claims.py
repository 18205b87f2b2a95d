"""Which contrasts each claim stands on, in words, and that each kind of contrast points the claimed way."""

from pathlib import Path

import pytest

from ship_trl.study.answers import ALL
from ship_trl.study.claims import FE, FT, beats, early, either, no_more, steady, steeper, trend
from ship_trl.study.config import to_study
from ship_trl.study.contrasts import Verdict
from ship_trl.study.measured import Study
from ship_trl.study.plan import SOURCES, plan_jobs
from tests.study.synthetic import make_study


def every_run() -> Study:
    """A study in which every planned run is there."""
    jobs = plan_jobs(to_study(["profile=smoke"]))
    places = {(j.part, j.label, j.arm): 0.99 for j in jobs if j.part != SOURCES}
    return make_study(places, seeds=2, episodes=300)


def test_every_claim_stands_on_these_contrasts() -> None:
    # Read contrasts.txt beside ../../ship_trl/study/hypotheses.py: it says in words what is measured.
    study, lines = every_run(), []
    for hypothesis in ALL:
        findings = [finding for test in hypothesis.tests for finding in test(study, hypothesis.name)]
        assert len(findings) == len(hypothesis.tests), hypothesis.name
        lines += [hypothesis.name, *(f"  {f.what}: {f.claimed.value}" for f in findings)]
    assert lines == Path(__file__).with_name("contrasts.txt").read_text().splitlines()


def pair(name: str, **ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", name, arm): end for arm, end in ends.items()}


def test_a_trend_follows_the_order_it_is_given() -> None:
    study = make_study(pair("high", FE1=0.3, FE2=0.45, FE3=0.6, FE4=0.75))
    (rises,), (falls,) = trend("high", *FE)(study, ""), trend("high", *FE[::-1])(study, "")
    assert (rises.verdict, falls.verdict) == (Verdict.supported, Verdict.contradicted)
    # Steps of 0.15 at the end are a little less in the mean over learning.
    assert rises.estimate.value == pytest.approx(0.15, abs=0.05) == -falls.estimate.value


def test_a_slope_is_compared_between_pairs() -> None:
    rising, falling = (0.3, 0.45, 0.6, 0.75), (0.75, 0.6, 0.45, 0.3)
    ends = pair("high", **dict(zip(FT, rising, strict=True))) | pair(
        "low", **dict(zip(FT, falling, strict=True))
    )
    study = make_study(ends)
    (found,), (other,) = steeper("high", "low", FT)(study, ""), steeper("low", "high", FT)(study, "")
    assert (found.verdict, other.verdict) == (Verdict.supported, Verdict.contradicted)
    (up,), (down,) = trend("high", *FT)(study, ""), trend("low", *FT)(study, "")
    # From the first arm to the last there are three steps.
    assert found.estimate.value == pytest.approx(3 * (up.estimate.value - down.estimate.value))


def test_the_steadier_arm_varies_less() -> None:
    study = make_study(pair("high", FE1=0.6), sd=0.01)
    study.records.update(make_study(pair("high", FT1=0.6), sd=0.2).records)
    (yes,), (no,) = steady("high", "FE1", "FT1")(study, ""), steady("high", "FT1", "FE1")(study, "")
    assert (yes.verdict, no.verdict) == (Verdict.supported, Verdict.contradicted)


def test_the_sooner_arm_gets_there_first_or_alone() -> None:
    study = make_study(pair("high", FE1=0.98, FT1=0.5), episodes=300)
    (yes,), (no,) = early("high", "FE1", "FT1")(study, ""), early("high", "FT1", "FE1")(study, "")
    assert (yes.verdict, no.verdict) == (Verdict.supported, Verdict.contradicted)
    # Five seeds, all of one before all of the other: no p below that of an exact test.
    (few,) = early("high", "FE1", "FT1")(make_study(pair("high", FE1=0.98, FT1=0.5), 5, episodes=300), "")
    assert few.p == pytest.approx(2 / 252)


def test_either_fails_only_if_each_does() -> None:
    study = make_study(pair("high", FE1=0.5, FE2=0.5, FE3=0.8))
    fails, unclear = beats("high", "FE1", "FE3"), beats("high", "FE1", "FE2")
    (one,), (both,) = either(fails, unclear)(study, ""), either(fails, fails)(study, "")
    assert one.verdict is not Verdict.contradicted and both.verdict is Verdict.contradicted


def test_no_more_than_another_may_be_less() -> None:
    study = make_study(pair("lowest", FTW=0.3, scratch=0.6))
    (less,) = no_more("lowest", "FTW", "scratch", "area")(study, "")
    (more,) = no_more("lowest", "scratch", "FTW", "area")(study, "")
    assert (less.verdict, more.verdict) == (Verdict.supported, Verdict.contradicted)
