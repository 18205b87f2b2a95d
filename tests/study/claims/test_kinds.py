"""Which contrasts each claim stands on, in words, and that each kind of contrast points the claimed way."""

from pathlib import Path

import pytest

from ship_trl.study.claims.hypotheses import OURS
from ship_trl.study.claims.kinds import Test, beats, control, interaction, means, rises, steady
from ship_trl.study.claims.verdicts import ALL
from ship_trl.study.compare import Finding
from ship_trl.study.plan import CONTROL_KINDS, FE, SOURCES, plan_jobs, to_study
from ship_trl.study.study import Study
from tests.study.synthetic import make_study


def every_run() -> Study:
    """A study in which every planned run is there."""
    jobs = plan_jobs(to_study(["profile=smoke"]))
    places = {(j.part, j.label, j.arm): 0.99 for j in jobs if j.part != SOURCES}
    return make_study(places, seeds=2, episodes=300)


def test_every_claim_stands_on_these_contrasts() -> None:
    # Read contrasts.txt beside ship_trl/study/claims/hypotheses.py: it says in words what is measured.
    study, lines = every_run(), []
    for hypothesis in (*ALL, *OURS):
        findings = [finding for test in hypothesis.tests for finding in test(study)]
        assert len(findings) == len(hypothesis.tests), hypothesis.name
        lines += [hypothesis.name, *(f"  {f.what}: {f.claimed.value}" for f in findings)]
    assert lines == (Path(__file__).parents[1] / "contrasts.txt").read_text().splitlines()


def pair(name: str, **ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", name, arm): end for arm, end in ends.items()}


def one(test: Test, study: Study) -> Finding:
    (found,) = test(study)
    return found


def test_a_rise_follows_the_order_it_is_given() -> None:
    study = make_study(pair("high", FE1=0.3, FE2=0.45, FE3=0.6, FE4=0.75))
    up, down = one(rises("high", *FE), study), one(rises("high", *FE[::-1]), study)
    assert up.p < 0.01 and down.against < 0.01
    # Three steps of 0.15 at the end are a little less in the mean over learning.
    assert up.estimate.value == pytest.approx(0.45, abs=0.1) == -down.estimate.value


def test_the_sooner_arm_gets_there_first_or_alone() -> None:
    study = make_study(pair("high", FE1=0.98, FT1=0.5), episodes=300)
    found = one(beats("high", "FE1", "FT1", "time"), study)
    assert found.estimate.value > 0.5 and found.p < 0.01
    assert one(beats("high", "FT1", "FE1", "time"), study).against < 0.01
    assert set(found.beside) == {"time to 0.5", "time to 0.8"}


def test_means_of_arms_are_compared() -> None:
    study = make_study(pair("low", FE1=0.5, FE2=0.7, FT1=0.9))
    found = one(means("low", ("FT1",), ("FE1", "FE2")), study)
    assert found.estimate.value == pytest.approx(0.3, abs=0.07) and found.p < 0.01
    assert found.beside["greedy area"].value == pytest.approx(found.estimate.value, abs=0.01)


def test_the_margin_is_a_share_of_what_could_be_gained_on_the_target(
    gains: dict[str, dict[str, float]],
) -> None:
    study = make_study(pair("high", FE1=0.9, FT1=0.9))
    assert one(beats("high", "FE1", "FT1"), study).margin == pytest.approx(0.2 * gains["2"]["area"])
    assert one(beats("high", "FE1", "FT1", "time"), study).margin == pytest.approx(0.2 * gains["2"]["time"])
    assert one(beats("high", "FE1", "FT1", "collision rise"), study).margin is None


@pytest.mark.parametrize(("low", "one_"), [(0.99, 0.75), (0.75, 0.99)])
def test_the_gain_of_reuse_depends_on_how_much_is_explored(low: float, one_: float) -> None:
    ends = {("reuse/epsilon_low", "2-new", "FTW"): low, ("reuse/epsilon_1", "2-new", "FTW"): one_}
    ends |= {(f"reuse/epsilon_{name}", "new", "scratch"): 0.7 for name in ("low", "1")}
    found = one(interaction("area"), make_study(ends))
    assert (found.p < 0.01) is (low > one_) and (found.against < 0.01) is (low < one_)


@pytest.mark.parametrize("kind", CONTROL_KINDS)
def test_a_control_that_has_learned_nothing_is_worse(kind: str) -> None:
    study = make_study({("pairs", "low", "FE3"): 0.8, ("controls", "low", f"FE3-{kind}"): 0.5})
    assert one(control("low", "FE3", kind), study).p < 0.01


def test_what_has_one_seed_or_none_is_not_measured() -> None:
    study = make_study(pair("high", FE1=0.5, FT1=0.5), seeds=1)
    for test in (beats("high", "FE1", "FT1"), steady("high", "FE1", "FT1"), beats("high", "FE1", "FTW")):
        assert test(study) == []


def test_what_no_study_measures_is_refused() -> None:
    with pytest.raises(ValueError, match="no metric worth; allowed: area,"):
        beats("high", "FE3", "scratch", "worth")
