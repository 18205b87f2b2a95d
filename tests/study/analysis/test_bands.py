"""Bands over seeds: within what the seeds have done, around their interquartile mean, the same each time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ship_trl.study.analysis.bands import LEAST, band

from ship_trl.study.analysis import bands
from ship_trl.study.analysis.statistics import interquartile_mean


def skewed(seed: int, seeds: int, places: int = 20) -> np.ndarray:
    """Curves of which some have collapsed: what makes a band of deviations pass the best."""
    rng = np.random.default_rng(seed)
    return np.minimum(rng.normal(0.9, 0.2, (seeds, places)) - (rng.random((seeds, 1)) < 0.3), 1.0)


@given(st.integers(0, 10_000), st.integers(LEAST, 16))
def test_a_band_holds_the_mean_and_lies_within_the_runs(seed: int, seeds: int) -> None:
    curves = skewed(seed, seeds)
    found = band(curves, np.random.default_rng(seed), resamples=50)
    assert np.all(curves.min(axis=0) <= found.low) and np.all(found.high <= curves.max(axis=0))
    assert np.all(found.low <= found.middle) and np.all(found.middle <= found.high)
    assert found.middle == pytest.approx(interquartile_mean(curves, axis=0))


def test_where_a_band_of_deviations_passes_the_best_this_one_does_not() -> None:
    curves = skewed(3, 15)
    assert np.any(curves.mean(axis=0) + curves.std(axis=0, ddof=1) > 1.05)
    assert np.all(band(curves, np.random.default_rng(0)).high <= 1.0)


@pytest.mark.parametrize("seeds", [4, 7, 15])
def test_equal_runs_have_a_band_without_width(seeds: int) -> None:
    # 0.1 and its like are not exact: a mean of them may differ from them in the last digit.
    curves = np.tile(np.linspace(-0.7, 0.1, 13), (seeds, 1))
    found = band(curves, np.random.default_rng(0))
    assert np.array_equal(found.low, curves[0]) and np.array_equal(found.high, curves[0])


def test_the_band_is_that_of_resampled_seeds() -> None:
    curves = np.random.default_rng(0).normal(0, 1, (15, 4))
    found = band(curves, np.random.default_rng(1), resamples=4_000)
    rng = np.random.default_rng(2)
    means = [interquartile_mean(curves[rng.integers(0, 15, 15)], axis=0) for _ in range(4_000)]
    low, high = np.quantile(means, (0.025, 0.975), axis=0)
    assert found.low == pytest.approx(low, abs=0.05) and found.high == pytest.approx(high, abs=0.05)


def test_a_generator_of_the_same_state_gives_the_same_band(monkeypatch: pytest.MonkeyPatch) -> None:
    curves = skewed(0, 9, places=50)
    one, two = (band(curves, np.random.default_rng(5)) for _ in range(2))
    # Neither does it matter how much is resampled at a time.
    monkeypatch.setattr(bands, "AT_ONCE", 1)
    three = band(curves, np.random.default_rng(5))
    for other in (two, three):
        assert np.array_equal(one.low, other.low) and np.array_equal(one.high, other.high)
    assert not np.array_equal(one.low, band(curves, np.random.default_rng(6)).low)


def test_too_few_seeds_have_no_band() -> None:
    with pytest.raises(ValueError, match="4 seeds or more, not 3"):
        band(np.zeros((3, 5)), np.random.default_rng(0))
