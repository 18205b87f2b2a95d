"""Confidence intervals from resampled episodes: states of one episode are alike and no independent draws."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ship_trl.study.statistics import Estimate

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RESAMPLES = 2000
# Confidence level of all intervals.
LEVEL = 0.95
UNKNOWN = Estimate(math.nan, math.nan, math.nan)


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
    low, high = np.nanquantile(resampled, ((1 - LEVEL) / 2, (1 + LEVEL) / 2))
    return Estimate(value, float(low), float(high))


def state_mean(values: Floats | Bools, episode: Ints, generator: np.random.Generator) -> Estimate:
    """Estimate the mean of a value over states [N]."""
    sums = per_episode(np.stack((values, np.ones_like(values)), 1).astype(np.float64), episode)
    resampled = resamples(len(sums), generator) @ sums
    return interval(float(values.mean()), resampled[:, 0] / resampled[:, 1])
