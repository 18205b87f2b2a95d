"""The model of gain, fitted with cases held out, and how much it explains; plan.md has the rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from sklearn.linear_model import Ridge
from sklearn.preprocessing import StandardScaler

from ship_trl.study.statistics import Estimate
from studies.law.data import CASES, COMMAND, LAW, LAW_OF_CASES, OF_CASES, OF_SOURCE, ORACLES, Data, Floats

PENALTY = 10.0
DRAWS, SEED, SCRATCH_HALF = 2000, 0, 5
MODELS: dict[str, tuple[str, ...]] = {
    "additive": CASES,
    **{f"additive + {name}": (*CASES, name) for name in (*OF_CASES, *OF_SOURCE, *ORACLES)},
    "law of cases": LAW_OF_CASES,
    "law of the command": COMMAND,
    "the law": LAW,
    "oracle": (*LAW, *ORACLES),
}


class Fit(NamedTuple):
    """A fitted model: scales of its columns, and the regression on them and on indicators."""

    scaler: StandardScaler
    ridge: Ridge


class Model:
    """A ridge regression of gains [arms, targets, sources] on columns and indicators of both cases."""

    def __init__(self, columns: Mapping[str, Floats], names: Sequence[str], gains: Floats) -> None:
        self.count = gains.shape[-1]
        self.target, self.source = np.nonzero(~np.eye(self.count, dtype=bool))
        self.values = np.stack([columns[name][self.target, self.source] for name in names], 1)
        one = np.eye(self.count)
        self.indicators = np.hstack([one[self.source], one[self.target]])
        self.gains = gains[:, self.target, self.source].T

    def fit(self, rows: np.ndarray | slice = slice(None)) -> Fit:
        """Fit to rows."""
        scaler = StandardScaler().fit(self.values[rows])
        inputs = np.hstack([scaler.transform(self.values[rows]), self.indicators[rows]])
        return Fit(scaler, Ridge(PENALTY).fit(inputs, self.gains[rows]))

    def predict_without(self, held: Sequence[int], at: np.ndarray, found: Floats) -> None:
        """Write predictions of rows into `found`, by a fit without the rows of the `held` cases."""
        scaler, ridge = self.fit(~(np.isin(self.target, held) | np.isin(self.source, held)))
        inputs = np.hstack([scaler.transform(self.values[at]), self.indicators[at]])
        found[:, self.target[at], self.source[at]] = ridge.predict(inputs).T

    def new_targets(self) -> Floats:
        """Predict each target by a fit without its case, [arms, targets, sources]."""
        found = np.full((self.gains.shape[1], self.count, self.count), np.nan)
        for target in range(self.count):
            self.predict_without([target], np.flatnonzero(self.target == target), found)
        return found

    def new_cases(self) -> Floats:
        """Predict each pair by a fit without both cases, [arms, targets, sources]."""
        found = np.full((self.gains.shape[1], self.count, self.count), np.nan)
        for one, other in combinations(range(self.count), 2):
            at = np.array([self.row(one, other), self.row(other, one)])
            self.predict_without([one, other], at, found)
        return found

    def new_cases_and(self) -> Floats:
        """Predict each pair without both cases and a third, [third, targets, sources], for the first arm."""
        found = np.full((self.count,) * 3, np.nan)
        for held in combinations(range(self.count), 3):
            pairs = list(permutations(held, 2))
            values = np.full((self.gains.shape[1], self.count, self.count), np.nan)
            self.predict_without(held, np.array([self.row(*pair) for pair in pairs]), values)
            for target, source in pairs:
                (third,) = {*held} - {target, source}
                found[third, target, source] = values[0, target, source]
        both = self.new_cases()[0]
        for case in range(self.count):
            found[case, case] = both[case]
        return found

    def row(self, target: int, source: int) -> int:
        """Return where a pair is."""
        return target * (self.count - 1) + source - (source > target)


def draws(*sizes: int) -> Iterator[Floats]:
    """Yield how often each of so many targets, sources or seeds is drawn, [draws, size]."""
    random = np.random.default_rng(SEED)
    for size in sizes:
        yield random.multinomial(size, np.full(size, 1 / size), DRAWS).astype(float)


def interval(point: float, drawn: Floats) -> Estimate:
    """Return a point with the middle 95 % of draws."""
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Estimate(float(point), float(low), float(high))


def centred(values: Floats, weights: Floats) -> Floats:
    """Subtract the weighted mean of each target; NaN counts nothing."""
    mean = np.nansum(values * weights, -1, keepdims=True) / np.maximum(weights.sum(-1, keepdims=True), 1e-12)
    return values - mean


def explained(gains: Floats, predicted: Floats, weights: Floats, *, within: bool) -> float:
    """Return R squared of predictions, with a weight for each pair; `within` targets both are centred."""
    weights = np.where(np.isfinite(gains), weights, 0.0)
    if within:
        gains, predicted = centred(gains, weights), centred(predicted, weights)
    mean = np.nansum(gains * weights) / weights.sum()
    error = np.nansum((gains - predicted) ** 2 * weights)
    return float(1 - error / np.nansum((gains - mean) ** 2 * weights))


def explained_draws(gains: Floats, predicted: Floats, *, within: bool) -> Floats:
    """Return R squared of gains [seeds, T, S], then that of each draw of targets, sources and seeds."""
    seeds, count, _ = gains.shape
    found = [explained(gains.mean(0), predicted, np.ones((count, count)), within=within)]
    for seed, target, source in zip(*draws(seeds, count, count), strict=True):
        mean = np.tensordot(seed / seeds, gains, 1)
        found.append(explained(mean, predicted, np.outer(target, source), within=within))
    return np.array(found)


def ceiling(data: Data, arm: str, *, within: bool) -> float:
    """Return the reliability of the mean gain of all seeds, by halves that share no run and no baseline."""
    gains, scratch = data.gains[arm], data.scratch
    halves = scratch[:, :SCRATCH_HALF].mean(1), scratch[:, SCRATCH_HALF:].mean(1)
    shift = [scratch.mean(1) - half for half in halves]
    found = []
    for one, other in permutations(range(len(gains)), 2):
        pair = [gains[seed] + move[:, None] for seed, move in zip((one, other), shift, strict=True)]
        if within:
            pair = [centred(each, np.isfinite(each).astype(float)) for each in pair]
        known = np.isfinite(pair[0])
        found.append(np.corrcoef(pair[0][known], pair[1][known])[0, 1])
    single, count = float(np.mean(found)), len(gains)
    return count * single / (1 + (count - 1) * single)
