"""Library functions in our terms: against plain re-computations, and at the rates they promise."""

import numpy as np
import pytest
from scipy import stats

from ship_trl.study import statistics as s
from ship_trl.study.contrasts import contrast


def sample(seed: int, mean: float = 0.0, sd: float = 1.0, count: int = 15) -> s.Sample:
    return np.random.default_rng(seed).normal(mean, sd, count)


def difference(one: s.Sample, other: s.Sample, seed: int) -> s.Estimate:
    return contrast("H", "a above b", {"a": one, "b": other}, {"a": 1, "b": -1}, seed).estimate


def test_the_interquartile_mean_leaves_out_the_outer_quarters() -> None:
    assert s.interquartile_mean(np.array([-900.0, 1, 2, 3, 4, 5, 6, 900.0])) == 3.5
    rows = np.array([[0.0, 1, 2, 99], [5, 6, 7, -99]])
    assert s.interquartile_mean(rows).tolist() == [1.5, 5.5]


def test_the_interval_is_that_of_scipys_bootstrap_and_of_resampling_by_hand() -> None:
    one, other = sample(1, 1.0), sample(2)
    found = difference(one, other, seed=3)
    # By hand, with draws of its own: seeds are drawn jointly.
    draws = np.random.default_rng(4).integers(15, size=(20_000, 15))
    gaps = stats.trim_mean(one[draws], 0.25, axis=1) - stats.trim_mean(other[draws], 0.25, axis=1)
    low, high = np.percentile(gaps, [2.5, 97.5])
    assert found.value == pytest.approx(stats.trim_mean(one, 0.25) - stats.trim_mean(other, 0.25))
    assert found.low == pytest.approx(low, abs=0.05) and found.high == pytest.approx(high, abs=0.05)
    assert difference(one, other, seed=3) == found != difference(one, other, seed=4)


def test_what_seeds_share_cancels() -> None:
    # A source network that is good for one arm is good for the other too.
    shared = 10 * sample(5)
    together = difference(shared + 1 + 0.1 * sample(6), shared + 0.1 * sample(7), seed=0)
    assert 0.7 < together.low < together.high < 1.3


def test_probability_of_improvement_counts_all_pairs_and_ties_half() -> None:
    one, other = np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 0.0])
    found = s.probability_of_improvement(one, other, seed=0)
    wins = sum((a > b) + 0.5 * (a == b) for a in one for b in other) / 9
    assert found.value == pytest.approx(wins) and 0 <= found.low <= wins <= found.high <= 1
    certain = s.probability_of_improvement(one + 9, other, seed=0)
    assert (certain.value, certain.low, certain.high) == (1.0, 1.0, 1.0)


def test_spread_is_compared() -> None:
    wide, narrow = sample(8, sd=5, count=40), sample(9, sd=1, count=40)
    found = s.bootstrap((narrow, wide), s.steadiness, seed=0)
    assert found.value == pytest.approx(np.log(wide.std(ddof=1) / narrow.std(ddof=1)))
    assert found.low > np.log(2) and s.bootstrap((wide, narrow), s.steadiness, seed=0).high < 0
    assert s.brown_forsythe(wide, narrow) < 1e-3 < s.brown_forsythe(wide, wide + 7)
    assert s.brown_forsythe(wide[:2], narrow[:2]) == s.brown_forsythe(np.ones(5), np.zeros(5)) == 1.0
    assert np.isfinite(s.steadiness(np.ones(5), np.ones(5)))


def test_a_trend_is_found_in_its_direction_only() -> None:
    rising = [sample(k, 0.8 * k) for k in range(4)]
    assert s.page_trend(rising) < 1e-3 and s.page_trend(rising[::-1]) > 0.9


def test_times_are_compared_with_their_censoring() -> None:
    early, late = np.arange(10.0, 25.0), np.arange(60.0, 75.0)
    seen = np.ones(15, np.bool_)
    assert s.log_rank((early, seen), (late, seen)) < 1e-4
    assert s.log_rank((early, seen), (early, seen)) == pytest.approx(1.0)
    # Agents that never get there tell as much as late ones.
    never = (np.full(15, 100.0), np.zeros(15, np.bool_))
    assert s.log_rank((early, seen), never) < 1e-4


def test_small_permutations_are_exact() -> None:
    assert s.permutation(np.arange(5.0), np.arange(5.0) + 100, seed=0) == pytest.approx(2 / 252)


def test_no_effect_is_students_t_and_certain_where_nothing_varies() -> None:
    values = sample(11, 0.4)
    t = values.mean() / (values.std(ddof=1) / np.sqrt(15))
    assert s.no_effect(values) == pytest.approx(2 * stats.t.sf(abs(t), 14))
    assert (s.no_effect(np.zeros(5)), s.no_effect(np.full(5, 0.3))) == (1.0, 0.0)


def test_a_difference_beyond_the_margin_is_ruled_out_on_both_sides() -> None:
    near = sample(12, 0.01, sd=0.01)
    assert s.within(near, 0.05) < 1e-6
    assert s.within(near + 0.2, 0.05) > 0.99 and s.within(near - 0.2, 0.05) > 0.99
    assert (s.within(np.zeros(5), 0.05), s.within(np.full(5, 0.3), 0.05)) == (0.0, 1.0)


def test_what_so_many_seeds_could_see() -> None:
    # By hand: the power of a two-sided t-test is that of a noncentral t beyond its critical values.
    effect = s.seen_effect(15)
    critical, shift = stats.t.ppf(0.975, 14), effect * np.sqrt(15)
    power = stats.nct.sf(critical, 14, shift) + stats.nct.cdf(-critical, 14, shift)
    assert power == pytest.approx(0.8, abs=1e-4)
    assert s.seen_effect(2) > s.seen_effect(5) > s.seen_effect(6) > effect
    # By trying, where the library's noncentral t gives up: five seeds, one contrast of fifty.
    effect = s.seen_effect(5, 0.001)
    draws = np.random.default_rng(0).normal(effect, 1, (100_000, 5))
    t = draws.mean(axis=1) / (draws.std(axis=1, ddof=1) / np.sqrt(5))
    assert np.mean(t > stats.t.isf(0.0005, 4)) == pytest.approx(0.8, abs=0.01)


def test_holm_is_the_step_down_method() -> None:
    p = [0.01, 0.04, 0.03, 0.005]
    assert s.holm(p) == pytest.approx([0.03, 0.06, 0.06, 0.02]) and s.holm([]) == []


def test_a_single_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="at least two seeds"):
        s.bootstrap([np.ones(1)], s.interquartile_mean, seed=0)


def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    # Percentile intervals of 15 are known to be somewhat too narrow.
    held = 0
    for seed in range(200):
        found = s.bootstrap(
            (sample(seed, 0.5), sample(10_000 + seed)),
            lambda a, b, axis: s.interquartile_mean(a, axis) - s.interquartile_mean(b, axis),
            seed,
            resamples=400,
        )
        held += found.low <= 0.5 <= found.high
    assert 0.87 <= held / 200 <= 0.99
