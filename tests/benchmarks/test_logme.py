"""LogME on features that tell the labels, and on noise."""

import numpy as np
import pytest

from benchmarks.logme import evidence, logme

COUNT, WIDTH = 400, 6


def make(noise: float, seed: int = 9001) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    labels = generator.integers(3, size=COUNT)
    features = np.eye(3)[labels] @ generator.normal(size=(3, WIDTH))
    return features + noise * generator.normal(size=(COUNT, WIDTH)), labels


def test_features_that_tell_the_labels_score_higher() -> None:
    scores = [logme(*make(noise)) for noise in (0.1, 0.5, 2.0, 50.0)]
    assert scores == sorted(scores, reverse=True)


def test_scale_and_rotation_of_features_do_not_count() -> None:
    features, labels = make(0.5)
    turn = np.linalg.qr(np.random.default_rng(9001).normal(size=(WIDTH, WIDTH)))[0]
    assert logme(7.0 * features @ turn, labels) == pytest.approx(logme(features, labels), abs=1e-3)


def test_the_evidence_is_that_of_the_gaussian_model() -> None:
    # log N(y; 0, I/beta + f f'/alpha) at the best alpha and beta, found on a grid.
    features, labels = make(0.5)
    features, y = features[:60], (labels[:60] == 1).astype(float)
    u, s, _ = np.linalg.svd(features, full_matrices=False)
    best = -np.inf
    for log_alpha in np.linspace(-3, 6, 46):
        for log_beta in np.linspace(-1, 5, 46):
            covariance = np.eye(60) / np.exp(log_beta) + features @ features.T / np.exp(log_alpha)
            _, determinant = np.linalg.slogdet(covariance)
            fit = y @ np.linalg.solve(covariance, y)
            best = max(best, -0.5 * (determinant + fit + 60 * np.log(2 * np.pi)))
    assert evidence(u, s, y) * 60 == pytest.approx(best, abs=0.05)
