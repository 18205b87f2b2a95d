"""The model of gain, fitted with cases held out, and how much it explains; plan.md has the rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, permutations
from typing import Any, NamedTuple

import numpy as np
from sklearn.linear_model import Ridge

from ship_trl.study.statistics import Estimate
from studies.law.data import CASES, COMMAND, LAW, LAW_OF_CASES, OF_CASES, OF_SOURCE, ORACLES, Data, Floats

PENALTY = 10.0
CONSTANT = 1e-9
DRAWS, SEED, SCRATCH_HALF = 2000, 0, 5
NULL, CASES_ONLY, ON_COMMAND, LAW_RULE = "additive", "law of cases", "law of the command", "law"
MODELS: dict[str, tuple[str, ...]] = {
    NULL: CASES,
    **{f"additive + {name}": (*CASES, name) for name in (*OF_CASES, *OF_SOURCE, *ORACLES)},
    CASES_ONLY: LAW_OF_CASES,
    ON_COMMAND: COMMAND,
    LAW_RULE: LAW,
    "oracle": (*LAW, *ORACLES),
}


class Fit(NamedTuple):
    """A fitted model: means and deviations of its columns, and the regression on them and on indicators."""

    mean: Floats
    scale: Floats
    ridge: Ridge

    def predict(self, values: Floats, indicators: Floats) -> Floats:
        """Return what is predicted of rows, [rows, arms]."""
        found: Floats = self.ridge.predict(np.hstack([(values - self.mean) / self.scale, indicators]))
        # One arm alone has no axis of its own.
        return found.reshape(len(values), -1)


class Model:
    """A ridge regression of gains [arms, targets, sources] on columns and indicators of both cases."""

    def __init__(self, columns: Mapping[str, Floats], names: Sequence[str], gains: Floats) -> None:
        self.count = gains.shape[-1]
        self.target, self.source = np.nonzero(~np.eye(self.count, dtype=bool))
        self.names = names
        self.values = self.take(columns)
        one = np.eye(self.count, dtype=bool)
        self.is_source, self.is_target = one[self.source], one[self.target]
        self.indicators = np.hstack([self.is_source, self.is_target]).astype(float)
        self.gains = gains[:, self.target, self.source].T

    def fit(self, rows: Any = slice(None)) -> Fit:
        """Fit to rows."""
        values = self.values[rows]
        # StandardScaler takes as long as the regression. Without some cases all others have one TCPA.
        mean, scale = values.mean(0), values.std(0)
        scale[scale < CONSTANT] = 1.0
        inputs = np.hstack([(values - mean) / scale, self.indicators[rows]])
        return Fit(mean, scale, Ridge(PENALTY).fit(inputs, self.gains[rows]))

    def fit_without(self, held: Sequence[int]) -> Fit:
        """Fit to the rows without the `held` cases."""
        return self.fit(~(self.is_target[:, held] | self.is_source[:, held]).any(1))

    def take(self, columns: Mapping[str, Floats]) -> Floats:
        """Return the values of all rows, [rows, columns]."""
        return np.stack([columns[name][self.target, self.source] for name in self.names], 1)

    def predict_without(self, held: Sequence[int], at: np.ndarray, found: Floats, values: Floats) -> None:
        """Write predictions of rows with `values` into `found`, by a fit without the `held` cases."""
        predicted = self.fit_without(held).predict(values[at], self.indicators[at])
        found[:, self.target[at], self.source[at]] = predicted.T

    def new_targets(self) -> Floats:
        """Predict each target by a fit without its case, [arms, targets, sources]."""
        found = np.full((self.gains.shape[1], self.count, self.count), np.nan)
        for target in range(self.count):
            self.predict_without([target], np.flatnonzero(self.target == target), found, self.values)
        return found

    def new_cases(self, columns: Mapping[str, Floats] | None = None) -> Floats:
        """Predict each pair by a fit without both cases, [arms, targets, sources]; also of other columns."""
        values = self.values if columns is None else self.take(columns)
        found = np.full((self.gains.shape[1], self.count, self.count), np.nan)
        for one, other in combinations(range(self.count), 2):
            at = np.array([self.row(one, other), self.row(other, one)])
            self.predict_without([one, other], at, found, values)
        return found

    def new_cases_and(self) -> Floats:
        """Predict each pair without both cases and a third, [third, arms, targets, sources].

        Where the third is the target itself, that is `new_cases`.
        """
        found = np.full((self.count, self.gains.shape[1], self.count, self.count), np.nan)
        for held in combinations(range(self.count), 3):
            pairs = list(permutations(held, 2))
            at = np.array([self.row(*pair) for pair in pairs])
            predicted = self.fit_without(held).predict(self.values[at], self.indicators[at])
            for (target, source), gains in zip(pairs, predicted, strict=True):
                (third,) = {*held} - {target, source}
                found[third, :, target, source] = gains
        both = self.new_cases()
        for case in range(self.count):
            found[case, :, case] = both[:, case]
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
