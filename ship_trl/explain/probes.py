"""Linear probes: how well a quantity can be read from a layer by ridge regression (Alain and Bengio 2016).

A probe that reads well shows that a layer holds a quantity, not that training put it there: pixels hold it
too, and so does a layer of random weights. So each probe stands beside one on raw pixels, one on the same
layer of untrained networks, and one whose labels are shuffled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ship_trl.explain.bootstrap import per_episode
from ship_trl.explain.states import Quantity, StateSet

Floats = NDArray[np.float64]
# Penalties tried, in units of the Gram matrix's mean diagonal.
PENALTIES = tuple(float(10.0**power) for power in range(-5, 3))


@dataclass(frozen=True)
class Reading:
    """How a probe of one layer does on held-out episodes.

    `errors` [E] are its squared errors summed over each episode, `spread` [E, 2 + D] what the variance of the
    truth is made of: states, sum of squares, sums. `checked` is R^2 on the episodes that chose the `penalty`,
    `shuffled` that of a probe fitted to shuffled labels; `predicted` and `truth` are [N, D].
    """

    errors: Floats
    spread: Floats
    checked: float
    shuffled: float
    penalty: float
    predicted: Floats
    truth: Floats

    @property
    def r2(self) -> float:
        """The share of variance explained: 1 is perfect, 0 no better than the mean."""
        return float(self.resampled(np.ones((1, len(self.errors))))[0])

    def resampled(self, counts: Floats) -> Floats:
        """Compute R^2 of resampled episodes: how often each is there [B, E] to [B]."""
        sums = counts @ self.spread
        total = sums[:, 1] - (sums[:, 2:] ** 2).sum(1) / sums[:, 0]
        left: Floats = 1.0 - counts @ self.errors / total
        return left


def read(kernel: Floats, quantity: Quantity, drawn: StateSet, generator: np.random.Generator) -> Reading:
    """Fit a probe and judge it on held-out episodes.

    Args:
        kernel: inner products of what the layer gives for all states [N, N].
        quantity: what is read; states in which it is not seen are left out.
        drawn: the states.
        generator: shuffles the labels of the control.
    """
    fitted, checked, tested = (
        np.flatnonzero(part & quantity.seen) for part in (drawn.fitted, drawn.checked, drawn.held_out)
    )
    both = np.concatenate((fitted, checked))
    # Units that make bearings and distances alike, so that the penalty means the same.
    truth = quantity.values / quantity.values[both].std(0).mean()
    shuffled = truth.copy()
    shuffled[both] = truth[generator.permutation(both)]
    labels = (truth, shuffled)
    tried = predict(kernel, np.hstack(labels), fitted, checked, PENALTIES)
    halves = np.split(tried, 2, axis=-1)
    scores = [[r2(one, y[checked]) for one in half] for half, y in zip(halves, labels, strict=True)]
    chosen = [PENALTIES[int(np.argmax(score))] for score in scores]
    predicted, aimless = (
        predict(kernel, y, both, tested, (penalty,))[0] for y, penalty in zip(labels, chosen, strict=True)
    )
    real = truth[tested]
    episode = drawn.episode[tested]
    parts = np.column_stack((np.ones(len(real)), (real**2).sum(1), real))
    return Reading(
        per_episode(((predicted - real) ** 2).sum(1), episode),
        per_episode(parts, episode),
        max(scores[0]),
        r2(aimless, real),
        chosen[0],
        predicted,
        real,
    )


def predict(
    kernel: Floats,
    truth: Floats,
    fitted: NDArray[np.int64],
    asked: NDArray[np.int64],
    penalties: Sequence[float],
) -> Floats:
    """Fit ridge regression, with an intercept that is not penalised, and predict.

    Args:
        kernel: [N, N].
        truth: [N, D].
        fitted: numbers of the states that it is fitted on.
        asked: numbers of those that it predicts.
        penalties: P of them, each in units of the mean diagonal over the fitted states.

    Returns:
        [P, len(asked), D].
    """
    inner, other = kernel[np.ix_(fitted, fitted)], kernel[np.ix_(asked, fitted)]
    columns, middle = inner.mean(0), float(inner.mean())
    inner = inner - columns - columns[:, None] + middle
    other = other - other.mean(1, keepdims=True) - columns + middle
    scale, mean = float(np.trace(inner)) / len(inner), truth[fitted].mean(0)
    found = np.empty((len(penalties), len(asked), truth.shape[1]))
    found[:] = mean
    for k, penalty in enumerate(penalties if scale > 0 else ()):
        ridge = inner.copy()
        ridge[np.diag_indices_from(ridge)] += penalty * scale
        factor = scipy.linalg.cho_factor(ridge, overwrite_a=True, check_finite=False)
        found[k] += other @ scipy.linalg.cho_solve(factor, truth[fitted] - mean, check_finite=False)
    return found


def r2(predicted: Floats, truth: Floats) -> float:
    """Share of the variance of the truth [N, D] that is explained."""
    return float(1.0 - ((predicted - truth) ** 2).sum() / ((truth - truth.mean(0)) ** 2).sum())
