"""The study's statistics: against plain re-computations and libraries, and at the rates they promise."""

import numpy as np
import pytest
from scipy import stats

from ship_trl.study import statistics as s
from studies.p_values import holm, p_above, p_below


def sample(seed: int, mean: float = 0.0, sd: float = 1.0, count: int = 15) -> s.Sample:
    return np.random.default_rng(seed).normal(mean, sd, count)


def test_the_interquartile_mean_leaves_out_the_outer_quarters() -> None:
    assert s.interquartile_mean(np.array([-900.0, 1, 2, 3, 4, 5, 6, 900.0])) == 3.5
    rows = np.array([[0.0, 1, 2, 99], [5, 6, 7, -99]])
    assert s.interquartile_mean(rows).tolist() == [1.5, 5.5]


@pytest.mark.parametrize("count", [4, 5, 10, 15, 16])
def test_the_error_is_yuens(count: int) -> None:
    values = sample(3, count=count)
    error, freedom = s.standard_error(values)
    # Of two samples, one of which does not vary, Yuen's t by SciPy is that of the other alone.
    still = np.linspace(-1e-9, 1e-9, count)
    found = stats.ttest_ind(values, still, equal_var=False, trim=s.TRIM)
    assert stats.trim_mean(values, 0.25) / error == pytest.approx(float(found.statistic), rel=1e-6)
    assert freedom == pytest.approx(s.FREEDOM_FACTOR * float(found.df), rel=1e-6)


def test_estimate_interval_and_p_speak_of_one_number() -> None:
    for seed in range(50):
        values = sample(seed, 0.4)
        found = s.estimate_mean(values, 0.025)
        assert found.value == pytest.approx(stats.trim_mean(values, 0.25))
        assert (found.low > 0) == (p_above(values) <= 0.025)
        assert (found.high < 0) == (p_below(values) <= 0.025)
        assert p_above(values) + p_below(values) == pytest.approx(1.0)


def test_a_share_has_wilsons_interval() -> None:
    found = s.share_interval(0, 20)
    assert (found.value, found.low) == (0.0, 0.0) and found.high == pytest.approx(0.161, abs=0.001)


def test_holm_is_the_step_down_method() -> None:
    p = [0.01, 0.04, 0.03, 0.005]
    assert holm(p) == pytest.approx([0.03, 0.06, 0.06, 0.02]) and holm([]) == []


def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    held = [
        found.low <= 0.5 <= found.high
        for found in (s.estimate_mean(sample(seed, 0.5)) for seed in range(1000))
    ]
    assert 0.93 <= np.mean(held) <= 0.97


def skewed(seed: int, seeds: int, places: int = 20) -> np.ndarray:
    """Curves of which some have collapsed, so that a band of deviations passes the best."""
    rng = np.random.default_rng(seed)
    return np.minimum(rng.normal(0.9, 0.2, (seeds, places)) - (rng.random((seeds, 1)) < 0.3), 1.0)


@pytest.mark.parametrize("seeds", [s.MIN_BAND_SEEDS, 7, 15])
def test_a_band_holds_the_mean_and_lies_within_the_runs(seeds: int) -> None:
    for seed in range(20):
        curves = skewed(seed, seeds)
        middle, low, high = s.band(curves, np.random.default_rng(seed))
        assert np.all(curves.min(axis=0) <= low) and np.all(high <= curves.max(axis=0))
        assert np.all(low <= middle) and np.all(middle <= high)
        assert middle == pytest.approx(s.interquartile_mean(curves, axis=0))
        # The best return, which a band of deviations would pass.
        assert np.all(high <= 1.0)
    # 0.1 and its like are not exact: a mean of equal numbers may differ from them in the last digit.
    equal = np.tile(np.linspace(-0.7, 0.1, 13), (seeds, 1))
    _, low, high = s.band(equal, np.random.default_rng(0))
    assert np.array_equal(low, equal[0]) and np.array_equal(high, equal[0])
