"""Gains, and judging measures on matrices whose answers are known."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.lockstep import OUTCOMES, add_outcomes
from studies.sources import judge
from studies.sources.logme import evidence, logme

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


def test_a_regression_finds_the_measure_that_counts_and_a_difference_is_of_two() -> None:
    values, gains = matrix(noise=0.02)
    found = judge.regression({"noise": matrix(9002)[0], "true": values}, gains)
    assert judge.by_target(found, gains.mean(0)).mean() > 0.8
    assert judge.difference(values, values, [gains]).value == 0
    assert judge.difference(values, matrix(9002)[0], [gains, gains]).low > 0


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20))
def test_rank_correlation_is_1_with_itself_and_0_with_a_constant(values: list[float]) -> None:
    row = np.array(values)
    assert judge.by_target(row[None], np.zeros((1, len(row)))) == 0
    assert judge.by_target(row[None], row[None]) == pytest.approx(0 if len(set(values)) == 1 else 1)


def test_gains_are_differences_of_scores_from_scratch() -> None:
    cases = ("1", "2", "3")

    def row(
        target: str, source: str, arm: str, seed: int, greedy: str, length: int = 30
    ) -> dict[str, object]:
        return {
            "target": target,
            "source": source,
            "arm": arm,
            "seed": seed,
            "length": length,
            "random": -100,
            "best_known": 100,
            "greedy": greedy,
            "reached": "00011",
            "source_greedy": "50 0" if source else "",
        }

    rows = [row(case, "", "scratch", 0, "-300 0 0 0 0") for case in cases]
    rows += [row(case, "", "scratch", 1, "-300 40 40 40 40") for case in cases]
    # Sources are longer, and no baseline.
    rows += [row(case, "", "scratch", 0, "100 100 100 100 100", 90) for case in cases]
    pairs = [(one, other) for one in cases for other in cases if one != other]
    rows += [row(one, other, "FTW", seed, "0 50 50 50 50") for seed in (0, 1) for one, other in pairs]
    for order in (1, -1):
        runs = pd.DataFrame(rows[::order])
        add_outcomes(runs)
        found = judge.make_gains(runs, cases)
        off = ~np.eye(3, dtype=bool)
        means = {kind: found["FTW", kind][:, off].mean() for kind in OUTCOMES}
        # Worse than random actions is no worse: before training the score of scratch is 0.
        assert means == pytest.approx({"area": 0.15, "jumpstart": 0.5, "end": 0.15, "success": 0})
        assert np.isnan(found["FTW", "area"][:, ~off]).all()
        assert (found["FTW", judge.KEPT][:, off] == 0.5).all()


def test_neither_an_oracle_nor_a_fitted_measure_wins_and_the_mean_over_arms_decides() -> None:
    table = pd.DataFrame(
        [
            ("a", "cases", "FE2", 0.3, 0.1),
            ("a", "cases", "FTW", 0.3, 0.4),
            ("b", "source", "FE2", 0.5, 0.0),
            ("b", "source", "FTW", -0.2, 0.9),
            ("c", judge.ORACLE, "FTW", 0.9, 0.9),
            ("d", judge.FITTED, "FTW", 0.9, 0.9),
        ],
        columns=["measure", "kind", "arm", "correlation", "gain"],
    )
    best = judge.winner(table)
    assert (best["measure"], best["arm"]) == ("a", "FTW")


def test_the_evidence_is_that_of_the_gaussian_model() -> None:
    # log N(y; 0, I/beta + f f'/alpha) at the best alpha and beta, found on a grid.
    generator = np.random.default_rng(9001)
    labels = generator.integers(3, size=60)
    clean = np.eye(3)[labels] @ generator.normal(size=(3, 6))
    features, y = clean + 0.5 * generator.normal(size=clean.shape), (labels == 1).astype(float)
    u, s, _ = np.linalg.svd(features, full_matrices=False)
    best = -np.inf
    for log_alpha in np.linspace(-3, 6, 46):
        for log_beta in np.linspace(-1, 5, 46):
            covariance = np.eye(60) / np.exp(log_beta) + features @ features.T / np.exp(log_alpha)
            _, determinant = np.linalg.slogdet(covariance)
            fit = y @ np.linalg.solve(covariance, y)
            best = max(best, -0.5 * (determinant + fit + 60 * np.log(2 * np.pi)))
    assert evidence(u, s, y) * 60 == pytest.approx(best, abs=0.05)
    # Features that tell the labels score higher; scale and rotation do not count.
    noisy = clean + 5.0 * generator.normal(size=clean.shape)
    turn = np.linalg.qr(generator.normal(size=(6, 6)))[0]
    assert logme(features, labels) > logme(noisy, labels)
    assert logme(7.0 * features @ turn, labels) == pytest.approx(logme(features, labels), abs=1e-3)
