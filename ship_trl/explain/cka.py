"""Similarity of what two layers encode: debiased linear centred kernel alignment (CKA).

Linear CKA (Kornblith, Norouzi, Lee and Hinton 2019, Similarity of Neural Network Representations Revisited)
is HSIC(K, L) / sqrt(HSIC(K, K) HSIC(L, L)), where K = X X' and L = Y Y' are the Gram matrices of the
activations X [N, P] and Y [N, Q]. It is 1 if Y is a rotated and scaled X. HSIC is estimated without bias
(Song et al. 2012, Feature Selection via Dependence Maximization). With bias, independent noise would look
similar in the first layers, where features outnumber states.
"""

from __future__ import annotations

import math

import numpy as np
from torch import Tensor

from ship_trl.explain.states import Floats, Ints
from ship_trl.study.statistics import CONFIDENCE, Estimate

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


def estimate(k: Floats, l: Floats, episode: Ints) -> Estimate:  # noqa: E741
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
