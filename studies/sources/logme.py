"""LogME: how well a linear map from features predicts labels, as its best evidence.

You, Liu, Wang and Long, 2021, "LogME: Practical Assessment of Pre-trained Models for Transfer Learning". A
label y [N], one of several as 0 or 1, is y = f w + noise of features f [N, D], with w ~ N(0, 1/alpha) and
noise ~ N(0, 1/beta). Alpha and beta maximise the evidence, by MacKay's fixed point (1992). The
mean over labels of log evidence / N is returned.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ITERATIONS, TOLERANCE = 100, 1e-4
RANK_TOLERANCE, TINY = 1e-9, 1e-12


def logme(features: Floats, labels: NDArray[np.int64]) -> float:
    """Compute LogME of features [N, D] for labels [N]; larger is better."""
    u, s, _ = np.linalg.svd(features, full_matrices=False)
    rank = int((s > s[0] * RANK_TOLERANCE).sum())
    return float(
        np.mean(
            [evidence(u[:, :rank], s[:rank], (labels == kind).astype(float)) for kind in np.unique(labels)]
        )
    )


def evidence(u: Floats, s: Floats, y: Floats) -> float:
    """Return the largest log evidence / N of y [N], for features u diag(s) v' of rank R: u [N, R], s [R]."""
    count, squares = len(y), s**2
    projected = u.T @ y
    outside = max(0.0, float(y @ y - projected @ projected))
    alpha = beta = 1.0
    for _ in range(ITERATIONS):
        before = alpha / beta
        effective = float(np.sum(beta * squares / (alpha + beta * squares)))
        weights = beta * s * projected / (alpha + beta * squares)
        alpha = effective / (float(weights @ weights) + TINY)
        beta = (count - effective) / (float(np.sum((projected - s * weights) ** 2)) + outside + TINY)
        if abs(alpha / beta - before) <= TOLERANCE * before:
            break
    weights = beta * s * projected / (alpha + beta * squares)
    error = float(np.sum((projected - s * weights) ** 2)) + outside
    # Directions without features cancel in the determinant.
    total = float(np.sum(np.log(alpha / (alpha + beta * squares)))) + count * math.log(beta / (2 * math.pi))
    return (total - beta * error - alpha * float(weights @ weights)) / 2 / count
