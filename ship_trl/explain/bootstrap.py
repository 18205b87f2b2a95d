"""Intervals over whole episodes: states of one episode are alike, so they are no draws of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# Resamples, and the level of every interval.
RESAMPLES = 2000
LEVEL = 0.95


class Estimate(NamedTuple):
    """A number and the ends of its interval."""

    value: float
    low: float
    high: float


def resamples(episodes: int, generator: np.random.Generator, count: int = RESAMPLES) -> Floats:
    """Draw how often each episode stands in each resample: float [count, episodes]; rows sum to episodes."""
    return generator.multinomial(episodes, np.full(episodes, 1 / episodes), count).astype(np.float64)


def per_episode(values: Floats, episode: NDArray[np.int64]) -> Floats:
    """Sum values [N, ...] over the states of each episode, in the order of their numbers: [E, ...]."""
    _, place = np.unique(episode, return_inverse=True)
    sums = np.zeros((place.max() + 1, *values.shape[1:]))
    np.add.at(sums, place, values)
    return sums


def interval(value: float, resampled: Floats) -> Estimate:
    """Give a number the percentile interval of its resamples [B]."""
    low, high = np.nanquantile(resampled, ((1 - LEVEL) / 2, (1 + LEVEL) / 2))
    return Estimate(value, float(low), float(high))


def share(hits: NDArray[np.bool_], episode: NDArray[np.int64], generator: np.random.Generator) -> Estimate:
    """Estimate the share of states [N] of which something is so."""
    both = per_episode(np.stack((hits, np.ones_like(hits)), 1).astype(np.float64), episode)
    sums = resamples(len(both), generator) @ both
    return interval(float(hits.mean()), sums[:, 0] / sums[:, 1])
