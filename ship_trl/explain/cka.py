"""How alike what two layers say of the same states is: centred kernel alignment.

Linear CKA (Kornblith, Norouzi, Lee and Hinton 2019, Similarity of Neural Network Representations Revisited)
is HSIC(K, L) / sqrt(HSIC(K, K) HSIC(L, L)) with K = X X' and L = Y Y' of the activations X [N, P], Y [N, Q].
It is 1 where Y is X turned and scaled. Here HSIC is the unbiased estimator (Song et al. 2012, Feature
Selection via Dependence Maximization): with more features than states, as in the first layers, the biased one
calls independent noise alike.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.explain.bootstrap import LEVEL, Estimate

Floats = NDArray[np.float64]
# Groups of episodes of the jackknife.
GROUPS = 10
# Standard errors from the middle to an end of an interval, at `LEVEL`.
ERRORS = 1.96
assert LEVEL == 0.95


def gram(activations: Tensor) -> Floats:
    """Compute the inner products of states: [N, ...] to [N, N], scaled so that its diagonal has mean 1.

    A layer in which nothing fires gives zeros.
    """
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
    """Compute debiased linear CKA of two Gram matrices [N, N]: 1 alike, 0 unrelated, NaN of a constant."""
    scale = hsic(k, k) * hsic(l, l)
    return hsic(k, l) / math.sqrt(scale) if scale > 0 else math.nan


def estimate(k: Floats, l: Floats, episode: NDArray[np.int64]) -> Estimate:  # noqa: E741
    """Compute CKA with an interval, by the jackknife over groups of whole episodes.

    A bootstrap would not do: it holds states twice, and a state is like itself.
    """
    group = np.unique(episode, return_inverse=True)[1] % GROUPS
    whole = cka(k, l)
    left = []
    for g in range(GROUPS):
        kept = np.flatnonzero(group != g)
        left.append(cka(k[np.ix_(kept, kept)], l[np.ix_(kept, kept)]))
    apart = np.array(left) - np.mean(left)
    error = math.sqrt((GROUPS - 1) / GROUPS * float((apart**2).sum()))
    return Estimate(whole, whole - ERRORS * error, min(1.0, whole + ERRORS * error))
