"""Each kind of contrast points the claimed way."""

import numpy as np
import pytest

from ship_trl.study.plan import FE
from ship_trl.study.statistics import Estimate, Sample
from ship_trl.study.study import Study
from studies.paper.contrasts import (
    Claimed,
    Spread,
    Test,
    add_p_values,
    beats,
    interaction,
    log_spread_ratio,
    p_within,
    rises,
    spread_test,
)
from tests.study.synthetic import GAIN, make_study


def pair(name: str, **ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", name, arm): end for arm, end in ends.items()}


def one(test: Test, study: Study) -> Estimate:
    found = test.measure(study)
    assert found is not None
    return found


def test_a_rise_follows_the_order_it_is_given() -> None:
    study = make_study(pair("high", FE1=0.3, FE2=0.45, FE3=0.6, FE4=0.75))
    up, down = one(rises("high", *FE), study), one(rises("high", *FE[::-1]), study)
    assert up.p < 0.01 and down.against < 0.01
    # Three steps of 0.15 at the end are a little less in the mean over learning.
    assert up.value == pytest.approx(0.45, abs=0.1) == -down.value


def test_the_sooner_arm_gets_there_first_or_alone() -> None:
    study = make_study(pair("high", FE1=0.98, FT1=0.5), episodes=300)
    found = one(beats("high", "FE1", "FT1", "time"), study)
    assert found.value > 0.5 and found.p < 0.01
    assert one(beats("high", "FT1", "FE1", "time"), study).against < 0.01


def test_the_margin_is_a_share_of_what_could_be_gained_on_the_target() -> None:
    study = make_study(pair("high", FE1=0.9, FT1=0.9))
    assert one(beats("high", "FE1", "FT1"), study).margin == pytest.approx(0.2 * GAIN["area"])
    assert one(beats("high", "FE1", "FT1", "time"), study).margin == pytest.approx(0.2 * GAIN["time"])
    assert one(beats("high", "FE1", "FT1", "collision rise"), study).margin is None


@pytest.mark.parametrize(("low", "one_"), [(0.99, 0.75), (0.75, 0.99)])
def test_the_gain_of_reuse_depends_on_how_much_is_explored(low: float, one_: float) -> None:
    ends = {("reuse/epsilon_low", "2-new", "FTW"): low, ("reuse/epsilon_1", "2-new", "FTW"): one_}
    ends |= {(f"reuse/epsilon_{name}", "new", "scratch"): 0.7 for name in ("low", "1")}
    found = one(interaction("area"), make_study(ends))
    assert (found.p < 0.01) is (low > one_) and (found.against < 0.01) is (low < one_)


def test_what_has_one_seed_or_none_is_not_measured() -> None:
    study = make_study(pair("high", FE1=0.5, FT1=0.5), seeds=1)
    for test in (beats("high", "FE1", "FT1"), Spread("high", "FE1", "FT1"), beats("high", "FE1", "FTW")):
        assert test.measure(study) is None
    with pytest.raises(ValueError, match="no metric worth; allowed: area,"):
        beats("high", "FE3", "scratch", "worth")


@pytest.mark.parametrize(("mean", "held"), [(-0.9, True), (0.0, True), (0.049, True), (0.2, False)])
def test_no_more_looks_to_one_side_of_the_margin(mean: float, held: bool) -> None:
    values = np.random.default_rng(0).normal(mean, 0.0001, 15)
    found = add_p_values(Estimate(mean, mean, mean, differences=tuple(values)), Claimed.no_more, 0.05)
    assert (found.p < 0.025) is held and (found.against < 0.025) is not held
    unknown = add_p_values(found, Claimed.no_more, None)
    assert (unknown.p, unknown.against) == (1.0, 1.0)


def curves(seed: int, sd: float, count: int = 15, mean: float = 0.0) -> Sample:
    rng = np.random.default_rng(seed)
    return mean + sd * rng.normal(size=(count, 1)) + 0.05 * rng.normal(size=(count, 30))


def test_the_steadier_arm_is_found_whatever_its_level() -> None:
    narrow, wide = curves(0, 0.2, mean=5.0), curves(1, 1.0)
    found, p, against = spread_test(narrow, wide, seed=0)
    spreads = [np.std(values, axis=0, ddof=1).mean() for values in (narrow, wide)]
    assert found.value == pytest.approx(np.log(spreads[1] / spreads[0])) and found.value > np.log(2)
    assert p < 0.01 and against > 0.9 and found.low > 0
    other, _, _ = spread_test(wide, narrow, seed=0)
    assert other.value == pytest.approx(-found.value) and other.high < 0


def test_few_seeds_change_places_in_all_ways_and_errors_are_the_jackknifes() -> None:
    one, other = curves(2, 0.3, count=4), curves(3, 0.6, count=4)
    found, p, against = spread_test(one, other, seed=0)
    left, right = one - one.mean(axis=0), other - other.mean(axis=0)
    standard = []
    for swap in np.ndindex(2, 2, 2, 2):
        chosen = np.array(swap, bool)[:, None]
        first, second = np.where(chosen, right, left), np.where(chosen, left, right)
        without = np.array(
            [log_spread_ratio(*(np.delete(c, k, 0) for c in (first, second))) for k in range(4)]
        )
        error = np.sqrt(3 / 4 * np.sum((without - without.mean()) ** 2))
        standard.append(log_spread_ratio(first, second) / error)
    assert found.value == pytest.approx(log_spread_ratio(one, other))
    assert p == pytest.approx(np.mean(np.array(standard) >= standard[0] - 1e-9))
    assert against == pytest.approx(np.mean(np.array(standard) <= standard[0] + 1e-9))
    for count in (2, 5):
        still, p, against = spread_test(np.ones((count, 9)), np.zeros((count, 9)), seed=0)
        assert (still.value, p, against) == (0.0, 1.0, 1.0)


def test_a_difference_beyond_the_margin_is_ruled_out_on_both_sides() -> None:
    near = np.random.default_rng(12).normal(0.01, 0.01, 15)
    assert p_within(near, 0.05) < 1e-5
    assert p_within(near + 0.2, 0.05) > 0.99 and p_within(near - 0.2, 0.05) > 0.99
    # What does not vary at all is a bound that all have met.
    assert p_within(np.zeros(5), 0.05) == 1.0
