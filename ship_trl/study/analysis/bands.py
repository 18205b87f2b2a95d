"""Curves of several seeds as one line and a band: what the seeds have done, and nothing that none has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ship_trl.study.analysis.statistics import CONFIDENCE, Sample, interquartile_mean

# With fewer seeds an interquartile mean cuts nothing off, and resampling shows a few values over and over.
LEAST = 4
# Of seeds: the ends of a band then vary by less than a line's width.
RESAMPLES = 500
# So many numbers are resampled at a time, which bounds the memory.
AT_ONCE = 2_000_000


@dataclass(frozen=True)
class Band:
    """An interquartile mean over seeds and the ends of its band, all [T]."""

    middle: Sample
    low: Sample
    high: Sample


def band(
    curves: Sample,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = CONFIDENCE,
) -> Band:
    """Return the interquartile mean over seeds with its percentile-bootstrap band.

    Seeds are drawn as whole curves. A band of mean and standard deviation can pass the best return that there
    is; this one lies within the range of the curves at each place, and holds the interquartile mean.

    Args:
        curves: a row a seed: [S, T].
        rng: draws the seeds; one of the same state gives the same band.
        resamples: how often.
        confidence: what share of the resampled means the band holds, at each place by itself.

    Raises:
        ValueError: fewer than `LEAST` seeds.
    """
    seeds, places = curves.shape
    if seeds < LEAST:
        raise ValueError(f"a band needs {LEAST} seeds or more, not {seeds}")
    drawn = rng.integers(0, seeds, (resamples, seeds))
    outside = (1 - confidence) / 2
    low, high = np.empty(places), np.empty(places)
    step = max(1, AT_ONCE // drawn.size)
    for begin in range(0, places, step):
        part = slice(begin, begin + step)
        # Seeds last: sorting what lies side by side is several times as quick.
        means = interquartile_mean(np.ascontiguousarray(curves.T[part])[:, drawn])
        low[part], high[part] = np.quantile(means, (outside, 1 - outside), axis=1)
    # Rounding may lead out of the range by a last digit, and of skewed seeds the percentiles may leave out
    # the mean itself.
    least, most = curves.min(axis=0), curves.max(axis=0)
    middle = np.clip(interquartile_mean(curves, axis=0), least, most)
    return Band(
        middle,
        np.clip(np.minimum(low, middle), least, most),
        np.clip(np.maximum(high, middle), least, most),
    )
