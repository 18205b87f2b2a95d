"""Judging measures on matrices whose answers are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import judge

SEEDS, CASES = 2, 8


def matrix(seed: int = 9001, noise: float = 0.0) -> tuple[judge.Floats, judge.Floats]:
    """Return a measure [targets, sources] and gains [seeds, targets, sources] that follow it, with noise."""
    generator = np.random.default_rng(seed)
    values = generator.normal(size=(CASES, CASES))
    gains = 0.1 * values + noise * generator.normal(size=(SEEDS, CASES, CASES))
    for one in (values, *gains):
        np.fill_diagonal(one, np.nan)
    return values, gains


def test_a_measure_that_is_the_gain_is_perfect() -> None:
    values, gains = matrix()
    found = judge.judge(values, gains)
    assert found["correlation"].value == pytest.approx(1)
    assert (found["regret"].value, found["top"].value) == (0, 1)
    assert found["gain"].value == pytest.approx(np.nanmax(gains[0], axis=1).mean())
    reverse = judge.judge(-values, gains)
    assert reverse["correlation"].value == pytest.approx(-1)
    assert reverse["top"].value == 0
    assert reverse["regret"].value > found["regret"].value


def test_tied_sources_share_the_choice() -> None:
    _, gains = matrix(noise=0.1)
    ties = np.where(np.isnan(gains[0]), np.nan, 1.0)
    found = judge.judge(ties, gains)
    assert found["gain"].value == pytest.approx(np.nanmean(gains))
    assert found["top"].value == pytest.approx(judge.TOP / (CASES - 1))
    assert found["correlation"].value == 0


def test_noise_makes_a_measure_worse_and_its_interval_holds_the_mean() -> None:
    values, gains = matrix(noise=0.2)
    found = judge.judge(values, gains)["correlation"]
    assert found.low < found.value < found.high < 1
    assert judge.judge(matrix(9002)[0], gains)["correlation"].value < found.value


def test_chance_alone_makes_no_regret() -> None:
    # Gains of pure noise: the source that one seed ranks first is no better in the other.
    generator = np.random.default_rng(9001)
    gains = generator.normal(size=(SEEDS, 400, CASES))
    values = generator.normal(size=(400, CASES))
    found = judge.judge(values, gains)["regret"]
    assert found.low < 0 < found.high


def test_reliability_is_1_without_noise_and_0_of_noise() -> None:
    assert judge.reliability(matrix()[1]) == pytest.approx((1, 1))
    generator = np.random.default_rng(9001)
    one, mean = judge.reliability(generator.normal(size=(SEEDS, 400, CASES)))
    assert abs(one) < 0.1
    # Spearman and Brown.
    assert mean == pytest.approx(2 * one / (1 + one))


def test_a_fit_knows_nothing_of_its_own_target() -> None:
    values, gains = matrix(noise=0.05)
    other = gains.copy()
    other[:, 3] = np.random.default_rng(9001).normal(size=(SEEDS, CASES))
    other[:, 3, 3] = np.nan
    measures = {"one": values, "two": matrix(9002)[0]}
    for before, after in (
        (judge.elsewhere(gains), judge.elsewhere(other)),
        (judge.regression(measures, gains), judge.regression(measures, other)),
    ):
        assert np.allclose(before[3], after[3], equal_nan=True)
        assert not np.allclose(before, after, equal_nan=True)


def test_a_regression_finds_the_measure_that_counts() -> None:
    values, gains = matrix(noise=0.02)
    found = judge.regression({"noise": matrix(9002)[0], "true": values}, gains)
    assert judge.by_target(found, gains.mean(0)).mean() > 0.8


def test_the_difference_of_a_measure_from_itself_is_0() -> None:
    values, gains = matrix(noise=0.1)
    found = judge.difference(values, values, [gains])
    assert (found.value, found.low, found.high) == (0, 0, 0)
    better = judge.difference(values, matrix(9002)[0], [gains, gains])
    assert better.low > 0


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20))
def test_rank_correlation_is_1_with_itself_and_0_with_a_constant(values: list[float]) -> None:
    row = np.array(values)
    assert judge.spearman(row, np.zeros(len(row))) == 0
    assert judge.spearman(row, row) == pytest.approx(0 if len(set(values)) == 1 else 1)
