"""Which sources to train: rules that choose up to five cases, and their regret; plan.md has both.

Values of a rule are [targets, sources], larger is better, NaN where both are one case.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
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
from studies.law.data import TRAINED, Data, Floats
from studies.law.model import CASES_ONLY, LAW_RULE, MODELS, ON_COMMAND, Model
from studies.sources.judge import elsewhere

MOST = 5
# Sources of the pairs high, low, lowest, of case new, and the one that is left.
PAIRS = ("1", "3", "5", "2", "4")
# Of the published Gaussian process.
NOISE = 0.1
RANDOM, HINDSIGHT, MEASURED = "random", "hindsight", "measured"
PUBLISHED = ("zero-shot", "equation 8", "equation 7", "paper's pairs", "MBTL", "SD-MBTL")
# They say which to train, not which of the trained to take: that is the zero-shot score, or equation 8.
ONLY_SETS = ("paper's pairs", "MBTL", "SD-MBTL", "SD-MBTL, L1")


class Rule(NamedTuple):
    """The order in which sources are chosen for each held-out target, and values by which one is picked."""

    orders: list[list[int]]
    values: Floats

    def sets(self, size: int) -> list[list[int]]:
        """Return for each held-out target the first sources, or all others where so many are wanted."""
        if size <= MOST:
            return [order[:size] for order in self.orders]
        every = range(len(self.values))
        return [[case for case in every if case != held] for held in every]


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


def mbtl(data: Data, columns: Mapping[str, Floats], without: int) -> list[int]:
    """Return sources in the order of MBTL: upper bounds of training scores, less what distance costs."""
    apart = np.linalg.norm(data.contexts[:, None] - data.contexts, axis=-1)
    # By source and target: zero-shot scores, and what the source has learned on its own case.
    scores = columns[ZERO_SHOT].T.copy()
    np.fill_diagonal(scores, np.nanmax(columns[TRAINED], 0))
    order = clusters(apart, without)[:1]
    while len(order) < MOST:
        known = scores[order]
        own = np.diagonal(known[:, order])
        slope = LinearRegression(fit_intercept=False, positive=True)
        slope.fit(apart[order].reshape(-1, 1), (own[:, None] - known).ravel())
        process = GaussianProcessRegressor(ConstantKernel() * RBF(), alpha=NOISE**2)
        # So few points leave a length at its bound.
        with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
            process.fit(data.contexts[order], own)
        mean, deviation = process.predict(data.contexts, return_std=True)
        upper = mean + np.sqrt(np.log(len(order) + 1)) * deviation
        worth = np.maximum(upper[:, None] - slope.coef_ * apart - known.max(0), 0).mean(1)
        worth[[*order, without]] = -np.inf
        order.append(int(worth.argmax()))
    return order


def clusters(apart: Floats, without: int) -> list[int]:
    """Return sources in the order in which each reduces the sum of all cases' distances to a source most.

    SD-MBTL does this where the quality of sources is constant, as in these tables (README.md). A source is at
    no distance from its own case.
    """
    nearest, order = np.full(len(apart), np.inf), list[int]()
    while len(order) < MOST:
        left = np.minimum(nearest, apart).sum(1)
        left[[*order, without]] = np.inf
        order.append(int(left.argmin()))
        nearest = np.minimum(nearest, apart[order[-1]])
    return order


def make_all_rules(data: Data) -> list[dict[str, Rule]]:
    """Make the rules for each judging seed, from the networks and gains of the other seeds alone."""
    every = range(len(data.gains[ARM]))
    others = [[seed for seed in every if seed != judging] for judging in every]
    gains = np.stack([data.gains[ARM][seeds].mean(0) for seeds in others])
    # Its columns are those of all seeds.
    of_cases = Model(data.columns(), MODELS[CASES_ONLY], gains)
    both, thirds = of_cases.new_cases(), of_cases.new_cases_and()
    found = []
    for at, seeds in enumerate(others):
        rules = make_rules(data, data.columns(seeds), gains[at])
        orders = [greedy(thirds[held, at], held) for held in range(data.count)]
        found.append({**rules, CASES_ONLY: Rule(orders, both[at])})
    return found


def make_rules(data: Data, columns: Mapping[str, Floats], gains: Floats) -> dict[str, Rule]:
    """Make the rules from columns and gains [targets, sources]; `RANDOM` and `HINDSIGHT` need none."""
    targets = range(data.count)
    law, command = (Model(columns, MODELS[name], gains[None]) for name in (LAW_RULE, ON_COMMAND))
    both, thirds = law.new_cases()[0], law.new_cases_and()[:, 0]
    rules = {LAW_RULE: Rule([greedy(thirds[held], held) for held in targets], both)}
    # Only picks one of all: it chooses no sets.
    rules[ON_COMMAND] = Rule([[]] * data.count, command.new_cases()[0])
    plain = {"zero-shot": ZERO_SHOT, "equation 8": "similarity", "equation 7": "distance"}
    for name, column in plain.items():
        rules[name] = Rule([greedy(columns[column], held) for held in targets], columns[column])
    places = [list(data.cases).index(name) for name in PAIRS]
    pairs = [[place for place in places if place != held] for held in targets]
    rules["paper's pairs"] = Rule(pairs, columns["similarity"])
    rules["MBTL"] = Rule([mbtl(data, columns, held) for held in targets], columns[ZERO_SHOT])
    for name, order in {"SD-MBTL": 2, "SD-MBTL, L1": 1}.items():
        apart = np.linalg.norm(data.contexts[:, None] - data.contexts, ord=order, axis=-1)
        rules[name] = Rule([clusters(apart, held) for held in targets], columns[ZERO_SHOT])
    others = [np.where(np.arange(data.count)[:, None] == held, np.nan, gains) for held in targets]
    rules[MEASURED] = Rule(
        [greedy(values, held) for held, values in enumerate(others)], elsewhere(gains[None])
    )
    return rules


def all_regrets(gains: Floats, rules: Sequence[Mapping[str, Rule]]) -> dict[tuple[str, int, bool], Floats]:
    """Return regrets [judging seed, target] by rule, number of sources, and whether each source is tried.

    `rules` has those for each judging seed. With 28 sources there is nothing to choose: a rule picks one.
    """
    count = gains.shape[-1]
    found = defaultdict(list)
    for seed, judged in enumerate(gains):
        known = np.delete(gains, seed, axis=0).mean(0)
        best = judged[np.arange(count), np.nanargmax(known, 1)]
        for name, rule in rules[seed].items():
            sizes = range(1, MOST + 1) if rule.orders[0] else ()
            for size in (*sizes, count - 1):
                sets = rule.sets(size)
                found[name, size, False].append(best - pick(rule.values, judged, sets))
                if size <= MOST:
                    found[name, size, True].append(best - pick(known, judged, sets))
        ranked = np.take_along_axis(judged, np.argsort(-known, 1), 1)[:, :-1]
        for size in (*range(1, MOST + 1), count - 1):
            found[RANDOM, size, False].append(best - np.nanmean(judged, 1))
            if size <= MOST:
                # The chance that the best of a random set has each rank.
                chance = comb(count - 2 - np.arange(count - 1), size - 1) / comb(count - 1, size)
                found[RANDOM, size, True].append(best - ranked @ chance)
                sets = best_sets(known, size)
                found[HINDSIGHT, size, True].append(best - pick(known, judged, sets))
    return {key: np.array(each) for key, each in found.items()}


def pick(values: Floats, judged: Floats, sets: Sequence[Sequence[int]]) -> Floats:
    """Return each target's gain from the source of its set with the largest value; the mean on ties."""
    found = []
    for target, members in enumerate(sets):
        own = values[target, members]
        found.append(judged[target, np.array(members)[own == own.max()]].mean())
    return np.array(found)


def best_sets(gains: Floats, size: int) -> list[list[int]]:
    """Return for each held-out target the set of others with the largest sum over targets of best gains."""
    count = len(gains)
    sets = np.array(list(combinations(range(count), size)))
    best = np.repeat(np.nanmin(gains, 1)[:, None], len(sets), 1)
    for column in sets.T:
        best = np.fmax(best, gains[:, column])
    worth = best.sum(0)
    return [sets[np.where((sets == held).any(1), -np.inf, worth).argmax()].tolist() for held in range(count)]
