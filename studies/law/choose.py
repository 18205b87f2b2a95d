"""Which sources to train: rules that choose up to five cases, and their regret; plan.md has both.

Values of a rule are [targets, sources], larger is better, NaN where both are one case.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import comb
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from sklearn.linear_model import LinearRegression

from ship_trl.transfer.law import ARM, ZERO_SHOT
from studies.law.data import LAW, LAW_OF_CASES, TRAINED, Data, Floats
from studies.law.model import Model
from studies.sources.judge import elsewhere

MOST = 5
# Sources of the pairs high, low, lowest, of case new, and the one that is left.
PAIRS = ("1", "3", "5", "2", "4")
# Of the published Gaussian process.
NOISE = 0.1
RANDOM, HINDSIGHT, MEASURED, LAW_RULE = "random", "hindsight", "measured", "law"
PUBLISHED = ("zero-shot", "equation 8", "equation 7", "paper's pairs", "MBTL", "SD-MBTL")


class Rule(NamedTuple):
    """The order in which sources are chosen for each held-out target, and values by which one is picked."""

    orders: list[list[int]]
    values: Floats


def greedy(values: Floats, without: int) -> list[int]:
    """Return sources in the order in which each raises the sum of the targets' best values most."""
    values = values[np.isfinite(values).any(1)]
    best, order = np.nanmin(values, 1), list[int]()
    for _ in range(MOST):
        raised = np.nansum(np.maximum(values - best[:, None], 0), 0)
        raised[[*order, without]] = -np.inf
        order.append(int(raised.argmax()))
        best = np.fmax(best, values[:, order[-1]])
    return order


def sequential(data: Data, without: int, *, detects: bool) -> list[int]:
    """Return sources in the order of MBTL, or of SD-MBTL if it `detects` structure."""
    contexts = data.contexts
    apart = np.linalg.norm(contexts[:, None] - contexts, axis=-1)
    # By source and target: zero-shot scores, and what the source has learned on its own case.
    scores = data.columns[ZERO_SHOT].T.copy()
    np.fill_diagonal(scores, np.nanmax(data.columns[TRAINED], 0))
    free = [case for case in range(data.count) if case != without]
    order = [min(free, key=lambda case: float(apart[case].sum()))]
    while len(order) < MOST:
        known = scores[order]
        lost = np.diagonal(known[:, order])[:, None] - known
        if detects and (len(order) == 1 or is_quality_constant(known, order)):
            nearest = apart[order].min(0)
            worth = [-np.minimum(nearest, apart[case]).sum() for case in range(data.count)]
        else:
            steps = np.abs(contexts[order][:, None] - contexts) if detects else apart[order][..., None]
            slope = LinearRegression(fit_intercept=False, positive=True)
            slope.fit(steps.reshape(lost.size, -1), lost.ravel())
            steps = np.abs(contexts[:, None] - contexts) if detects else apart[..., None]
            process = GaussianProcessRegressor(ConstantKernel() * RBF(), alpha=NOISE**2)
            with warnings.catch_warnings():
                # So few points leave a length at its bound.
                warnings.simplefilter("ignore", ConvergenceWarning)
                process.fit(contexts[order], np.diagonal(known[:, order]))
            mean, deviation = process.predict(contexts, return_std=True)
            upper = mean + np.sqrt(np.log(len(order) + 1)) * deviation
            worth = np.maximum(upper[:, None] - steps @ slope.coef_ - known.max(0), 0).mean(1)
        order.append(max((case for case in free if case not in order), key=lambda case: float(worth[case])))
    return order


def is_quality_constant(known: Floats, order: Sequence[int]) -> bool:
    """Return whether sources [k, targets] differ less on their own case than over targets."""
    left = known - known.mean(0)
    own = left[np.arange(len(order)), order]
    return bool(own.std() < left.std(1).mean())


def make_rules(data: Data, predicted: Mapping[str, Floats]) -> dict[str, Rule]:
    """Make all rules but `RANDOM` and `HINDSIGHT`; `predicted` are gains of pairs that are both new."""
    gains, columns = data.gains[ARM], data.columns
    targets = range(data.count)
    rules = {}
    for name, names in {LAW_RULE: LAW, "law of cases": LAW_OF_CASES}.items():
        thirds = Model(columns, names, gains.mean(0)[None]).new_cases_and()
        rules[name] = Rule([greedy(thirds[held], held) for held in targets], predicted[name])
    plain = {"zero-shot": ZERO_SHOT, "equation 8": "similarity", "equation 7": "distance"}
    for name, column in plain.items():
        rules[name] = Rule([greedy(columns[column], held) for held in targets], columns[column])
    places = [list(data.cases).index(name) for name in PAIRS]
    pairs = [[place for place in places if place != held] for held in targets]
    rules["paper's pairs"] = Rule(pairs, columns["similarity"])
    for name, detects in {"MBTL": False, "SD-MBTL": True}.items():
        orders = [sequential(data, held, detects=detects) for held in targets]
        rules[name] = Rule(orders, columns[ZERO_SHOT])
    others = [np.where(np.arange(data.count)[:, None] == held, np.nan, gains.mean(0)) for held in targets]
    rules[MEASURED] = Rule([greedy(values, held) for held, values in enumerate(others)], elsewhere(gains))
    return rules


def all_regrets(gains: Floats, rules: Mapping[str, Rule]) -> dict[tuple[str, int, bool], Floats]:
    """Return regrets [judging seed, target] by rule, number of sources, and whether each source is tried.

    With 28 sources there is nothing to choose: a rule picks one of all.
    """
    count = gains.shape[-1]
    found: dict[tuple[str, int, bool], Floats] = {}
    for seed, judged in enumerate(gains):
        known = np.delete(gains, seed, axis=0).mean(0)
        best = judged[np.arange(count), np.nanargmax(known, 1)]

        def note(
            rule: str, size: int, tried: bool, value: Floats, seed: int = seed, best: Floats = best
        ) -> None:
            found.setdefault((rule, size, tried), np.full(gains.shape[:2], np.nan))[seed] = best - value

        for name, (orders, values) in rules.items():
            sizes = range(1, MOST + 1) if orders[0] else ()
            for size in (*sizes, count - 1):
                sets = [order[:size] for order in orders]
                if size > MOST:
                    sets = [[case for case in range(count) if case != held] for held in range(count)]
                note(name, size, False, pick(values, judged, sets))
                if size <= MOST:
                    note(name, size, True, pick(known, judged, sets))
        ranked = np.take_along_axis(judged, np.argsort(-known, 1), 1)[:, :-1]
        for size in (*range(1, MOST + 1), count - 1):
            note(RANDOM, size, False, np.nanmean(judged, 1))
            if size <= MOST:
                # The chance that the best of a random set has each rank.
                chance = comb(count - 2 - np.arange(count - 1), size - 1) / comb(count - 1, size)
                note(RANDOM, size, True, ranked @ chance)
                note(HINDSIGHT, size, True, pick(known, judged, best_sets(known, size)))
    return found


def pick(values: Floats, judged: Floats, sets: Sequence[Sequence[int]]) -> Floats:
    """Return each target's gain from the source of its set with the largest value; the mean on ties."""
    found = []
    for target, members in enumerate(sets):
        own = values[target, members]
        found.append(judged[target, np.array(members)[own == own.max()]].mean())
    return np.array(found)


def best_sets(gains: Floats, size: int) -> list[tuple[int, ...]]:
    """Return for each held-out target the set of others with the largest sum over targets of best gains."""
    count = len(gains)
    sets = np.array(list(combinations(range(count), size)))
    best = np.repeat(np.nanmin(gains, 1)[:, None], len(sets), 1)
    for column in sets.T:
        best = np.fmax(best, gains[:, column])
    worth = best.sum(0)
    return [
        tuple(map(int, sets[np.where((sets == held).any(1), -np.inf, worth).argmax()]))
        for held in range(count)
    ]
