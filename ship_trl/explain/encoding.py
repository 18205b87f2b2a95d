"""What a layer encodes, from the Gram matrix of its activations: linear probes, and CKA with another layer.

A probe is a ridge regression from a layer to a quantity (Alain and Bengio 2016). A good probe does not show
that training put the quantity into the layer: pixels and random layers hold it too. The controls are raw
pixels, the same layer of untrained networks, and shuffled labels. Intervals are of resampled episodes: states
of one episode are alike and no independent draws.

Linear CKA (Kornblith, Norouzi, Lee and Hinton 2019, Similarity of Neural Network Representations Revisited)
is HSIC(K, L) / sqrt(HSIC(K, K) HSIC(L, L)), where K = X X' and L = Y Y' are the Gram matrices of the
activations X [N, P] and Y [N, Q]. It is 1 if Y is a rotated and scaled X. HSIC is estimated without bias
(Song et al. 2012, Feature Selection via Dependence Maximization). With bias, independent noise would look
similar in the first layers, where features outnumber states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from torch import Tensor

from ship_trl.explain.states import Bools, Floats, Ints, Quantity, StateSet
from ship_trl.study.statistics import CONFIDENCE, Estimate

RESAMPLES = 2000
UNKNOWN = Estimate(math.nan, math.nan, math.nan)
# In units of the Gram matrix's mean diagonal.
PENALTIES = tuple(float(10.0**power) for power in range(-5, 3))
JACKKNIFE_GROUPS = 10
# Half an interval, in standard errors, at `CONFIDENCE`.
STANDARD_ERRORS = 1.96
assert CONFIDENCE == 0.95


def gram(activations: Tensor) -> Floats:
    """Compute the Gram matrix of activations, [N, ...] to [N, N], with a diagonal of mean 1 (or zeros)."""
    flat = activations.flatten(1).float()
    flat = flat - flat.mean(0)
    kernel = (flat @ flat.T).double().numpy()
    scale = float(np.trace(kernel)) / len(kernel)
    return kernel / scale if scale > 0 else kernel


@dataclass(frozen=True)
class Probe:
    """A fitted probe and its accuracy on held-out episodes.

    `errors` [E] are squared errors, summed by episode. `moments` [E, 2 + D] are counts of states, sums of
    squares and sums of the labels, which give their variance. `validation_r2` is R² on the episodes that
    choose the penalty, `shuffled_r2` is R² with shuffled labels.
    """

    errors: Floats
    moments: Floats
    validation_r2: float
    shuffled_r2: float

    @property
    def r2(self) -> float:
        """Compute R²: 1 is perfect, 0 no better than the mean."""
        return float(self.resampled_r2(np.ones((1, len(self.errors))))[0])

    def resampled_r2(self, counts: Floats) -> Floats:
        """Compute R² of resampled episodes: counts [B, E] to [B]."""
        sums = counts @ self.moments
        total = sums[:, 1] - (sums[:, 2:] ** 2).sum(1) / sums[:, 0]
        found: Floats = 1.0 - counts @ self.errors / total
        return found


def fit_probe(kernel: Floats, quantity: Quantity, states: StateSet, generator: np.random.Generator) -> Probe:
    """Fit a probe and test it on held-out episodes; `generator` shuffles the labels of the control.

    `kernel` is the Gram matrix [N, N] of a layer's activations. States without the quantity are left out.
    """
    training, validation, tested = (
        np.flatnonzero(part & quantity.visible)
        for part in (states.training, states.validation, states.held_out)
    )
    both = np.concatenate((training, validation))
    # Bearings and distances get the same scale, so that a penalty means the same for both.
    labels = quantity.values / quantity.values[both].std(0).mean()
    shuffled = labels.copy()
    shuffled[both] = labels[generator.permutation(both)]
    kinds = (labels, shuffled)
    tried = np.split(predict(kernel, np.hstack(kinds), training, validation, PENALTIES), 2, axis=-1)
    scores = [[r2(one, y[validation]) for one in half] for half, y in zip(tried, kinds, strict=True)]
    penalties = [PENALTIES[int(np.argmax(score))] for score in scores]
    predicted, control = (
        predict(kernel, y, both, tested, (penalty,))[0] for y, penalty in zip(kinds, penalties, strict=True)
    )
    truth = labels[tested]
    episode = states.episode[tested]
    moments = np.column_stack((np.ones(len(truth)), (truth**2).sum(1), truth))
    return Probe(
        errors=per_episode(((predicted - truth) ** 2).sum(1), episode),
        moments=per_episode(moments, episode),
        validation_r2=max(scores[0]),
        shuffled_r2=r2(control, truth),
    )


def predict(kernel: Floats, labels: Floats, fitted: Ints, tested: Ints, penalties: Sequence[float]) -> Floats:
    """Fit ridge regression with an unpenalised intercept, and predict: float [P, len(tested), D].

    Args:
        kernel: Gram matrix of all states [N, N].
        labels: of all states [N, D].
        fitted: indices of the states to fit on.
        tested: indices of the states to predict.
        penalties: P penalties, in units of the mean diagonal over the fitted states.
    """
    inner, other = kernel[np.ix_(fitted, fitted)], kernel[np.ix_(tested, fitted)]
    columns, middle = inner.mean(0), float(inner.mean())
    inner = inner - columns - columns[:, None] + middle
    other = other - other.mean(1, keepdims=True) - columns + middle
    scale, mean = float(np.trace(inner)) / len(inner), labels[fitted].mean(0)
    predicted = np.empty((len(penalties), len(tested), labels.shape[1]))
    predicted[:] = mean
    for k, penalty in enumerate(penalties if scale > 0 else ()):
        ridge = inner.copy()
        ridge[np.diag_indices_from(ridge)] += penalty * scale
        factor = scipy.linalg.cho_factor(ridge, overwrite_a=True, check_finite=False)
        predicted[k] += other @ scipy.linalg.cho_solve(factor, labels[fitted] - mean, check_finite=False)
    return predicted


def r2(predicted: Floats, labels: Floats) -> float:
    """Compute the share of the variance of labels [N, D] that is explained."""
    return float(1.0 - ((predicted - labels) ** 2).sum() / ((labels - labels.mean(0)) ** 2).sum())


def resamples(episodes: int, generator: np.random.Generator, count: int = RESAMPLES) -> Floats:
    """Draw how often each episode is in each resample: [count, episodes], each row sums to `episodes`."""
    return generator.multinomial(episodes, np.full(episodes, 1 / episodes), count).astype(np.float64)


def per_episode(values: Floats, episode: Ints) -> Floats:
    """Sum values [N, ...] over the states of each episode: [E, ...], ordered by episode number."""
    _, index = np.unique(episode, return_inverse=True)
    sums = np.zeros((index.max() + 1, *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def interval(value: float, resampled: Floats) -> Estimate:
    """Add the percentile interval of the resampled values [B] to a value."""
    low, high = np.nanquantile(resampled, ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    return Estimate(value, float(low), float(high))


def state_mean(values: Floats | Bools, episode: Ints, generator: np.random.Generator) -> Estimate:
    """Estimate the mean of a value over states [N]."""
    sums = per_episode(np.stack((values, np.ones_like(values)), 1).astype(np.float64), episode)
    resampled = resamples(len(sums), generator) @ sums
    return interval(float(values.mean()), resampled[:, 0] / resampled[:, 1])


def hsic(k: Floats, l: Floats) -> float:  # noqa: E741 (the names of the paper)
    """Estimate the Hilbert-Schmidt independence criterion of two Gram matrices [N, N] without bias; N > 3."""
    n = len(k)
    k, l = k - np.diag(np.diag(k)), l - np.diag(np.diag(l))  # noqa: E741
    product, rows = float((k * l).sum()), float(k.sum(0) @ l.sum(0))
    whole = float(k.sum() * l.sum()) / ((n - 1) * (n - 2))
    return (product + whole - 2 * rows / (n - 2)) / (n * (n - 3))


def cka(k: Floats, l: Floats) -> float:  # noqa: E741
    """Compute debiased linear CKA of two Gram matrices [N, N]; NaN if one of them is constant."""
    scale = hsic(k, k) * hsic(l, l)
    return hsic(k, l) / math.sqrt(scale) if scale > 0 else math.nan


def estimate_cka(k: Floats, l: Floats, episode: Ints) -> Estimate:  # noqa: E741
    """Compute CKA with a jackknife interval over groups of whole episodes.

    A bootstrap would repeat states, and a repeated state is similar to itself.
    """
    group = np.unique(episode, return_inverse=True)[1] % JACKKNIFE_GROUPS
    value = cka(k, l)
    left_out = []
    for g in range(JACKKNIFE_GROUPS):
        kept = np.flatnonzero(group != g)
        left_out.append(cka(k[np.ix_(kept, kept)], l[np.ix_(kept, kept)]))
    deviations = np.array(left_out) - np.mean(left_out)
    error = math.sqrt((JACKKNIFE_GROUPS - 1) / JACKKNIFE_GROUPS * float((deviations**2).sum()))
    return Estimate(value, value - STANDARD_ERRORS * error, min(1.0, value + STANDARD_ERRORS * error))
