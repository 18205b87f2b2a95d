"""Gains over scratch, and how well a measure of similarity predicts them; README.md has the rules.

Gains are [seeds, targets, sources], values of measures [targets, sources], larger for more similar; both are
NaN where source and target are one case.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ship_trl.config.arm import SCRATCH
from ship_trl.study.statistics import Estimate
from studies.lockstep import OUTCOMES

Floats = NDArray[np.float64]
DRAWS, LEVEL, TOP = 2000, 95.0, 3
# An arm whose gains agree less than this between seeds is not judged.
MIN_RELIABILITY = 0.3
# Not a gain: the score on the source's case after training on the target.
KEPT = "kept"
# Kinds of measures that cannot win.
ORACLE, FITTED = "oracle", "fitted"


def make_gains(runs: pd.DataFrame, cases: Sequence[str]) -> dict[tuple[str, str], Floats]:
    """Return the gains in each of `OUTCOMES`, and what is `KEPT`, of each arm: by arm and kind."""
    transfers = runs[runs["source"] != ""]
    scratch = runs[(runs["arm"] == SCRATCH.name) & (runs["length"] == transfers["length"].iloc[0])]
    baseline = {case: own[list(OUTCOMES)].to_numpy().mean(0) for case, own in scratch.groupby("target")}
    scale = runs.drop_duplicates("target").set_index("target")[["random", "best_known"]].astype(float)
    random, known = (scale[name].loc[transfers["source"]].to_numpy() for name in scale)
    left = transfers["source_greedy"].str.split().str[-1].to_numpy(np.float64)
    base = np.array([baseline[case] for case in transfers["target"]])
    gained = transfers.assign(
        **{name: transfers[name] - base[:, k] for k, name in enumerate(OUTCOMES)},
        **{KEPT: np.maximum(0.0, (left - random) / (known - random))},
    ).set_index(["seed", "target", "source"])
    places = pd.MultiIndex.from_product([sorted(transfers["seed"].unique()), cases, cases])
    return {
        (str(arm), kind): own[kind].reindex(places).to_numpy().reshape(-1, len(cases), len(cases))
        for arm, own in gained.groupby("arm", sort=False)
        for kind in (*OUTCOMES, KEPT)
    }


def by_target(one: Floats, other: Floats) -> Floats:
    """Return the rank correlation over sources within each target, [targets]; 0 where one is constant."""
    a, b = (pd.DataFrame(each).rank(axis=1) for each in (one, other))
    return a.corrwith(b, axis=1).fillna(0.0).to_numpy()


def reliability(gains: Floats) -> tuple[float, float]:
    """Return the mean correlation of two seeds within targets, and the reliability of the mean of all seeds.

    The second number is by Spearman and Brown: how the mean of k seeds would correlate with k others.
    """
    count = len(gains)
    pairs = [by_target(gains[a], gains[b]).mean() for a in range(count) for b in range(a)]
    one = float(np.mean(pairs))
    return one, count * one / (1 + (count - 1) * one)


def choice(values: Floats) -> Floats:
    """Return which source a measure ranks first, as shares [targets, sources]: ties share alike."""
    first = values == np.nanmax(values, axis=1, keepdims=True)
    shares: Floats = first / first.sum(1, keepdims=True)
    return shares


def chosen(values: Floats, gains: Floats) -> Floats:
    """Return the gain of the source that a measure ranks first, [targets]; the mean of tied ones."""
    found: Floats = np.nansum(choice(values) * gains, axis=1)
    return found


def regrets(values: Floats, gains: Floats) -> Floats:
    """Return what the chosen source loses, [targets].

    The best source is chosen by one seed and both gains are taken from the others, so that chance makes no
    regret; that is done with each seed.
    """
    targets = np.arange(len(values))
    found = []
    for seed in range(len(gains)):
        best = np.nanargmax(gains[seed], axis=1)
        others = np.delete(gains, seed, axis=0).mean(0)
        found.append(others[targets, best] - chosen(values, others))
    return np.mean(found, axis=0)


def hits(values: Floats, gains: Floats) -> Floats:
    """Return how much of the choice is among the `TOP` best by the mean of the seeds, [targets]."""
    ranks = pd.DataFrame(gains.mean(0)).rank(axis=1, method="min", ascending=False)
    found: Floats = (choice(values) * (ranks <= TOP).to_numpy()).sum(1)
    return found


def elsewhere(gains: Floats) -> Floats:
    """Return the mean gain of each source on all other targets, [targets, sources]."""
    mean = gains.mean(0)
    found: Floats = (np.nansum(mean, axis=0) - mean) / (np.isfinite(mean).sum(0) - 1)
    return found


def shares(values: Floats) -> Floats:
    """Return ranks within each target, from 0 to 1."""
    ranks = pd.DataFrame(values).rank(axis=1) - 1
    return ranks.div(np.maximum(1, np.isfinite(values).sum(1) - 1), axis=0).to_numpy()


def regression(measures: Mapping[str, Floats], gains: Floats) -> Floats:
    """Predict the rank of gains by a linear regression on the ranks of measures, [targets, sources].

    It is fitted for each target on all others.
    """
    wanted = shares(gains.mean(0))
    inputs = np.stack([shares(values) for values in measures.values()] + [np.ones_like(wanted)], -1)
    known, found = np.isfinite(wanted), np.full(wanted.shape, np.nan)
    for target in range(len(wanted)):
        others = known & (np.arange(len(wanted)) != target)[:, None]
        weights, *_ = np.linalg.lstsq(inputs[others], wanted[others], rcond=None)
        found[target, known[target]] = inputs[target, known[target]] @ weights
    return found


def interval(values: Floats, seed: int = 0) -> Estimate:
    """Return the mean over targets with a bootstrap interval; all measures get the same draws of targets."""
    at = np.random.default_rng(seed).integers(len(values), size=(DRAWS, len(values)))
    low, high = np.percentile(values[at].mean(1), [(100 - LEVEL) / 2, (100 + LEVEL) / 2])
    return Estimate(float(values.mean()), float(low), float(high))


def judge(values: Floats, gains: Floats) -> dict[str, Estimate]:
    """Judge a measure for an arm by the means over targets.

    `correlation` is the rank correlation within targets, `top` the share of targets where the first source is
    among the best, and `gain` the gain of that source.
    """
    mean = gains.mean(0)
    return {
        "correlation": interval(by_target(values, mean)),
        "regret": interval(regrets(values, gains)),
        "top": interval(hits(values, gains)),
        "gain": interval(chosen(values, mean)),
    }


def winner(table: pd.DataFrame) -> pd.Series:
    """Return the row of the measure with the largest mean correlation over arms, with its most gaining arm.

    Neither oracles nor fitted ones can win.
    """
    free = table[~table["kind"].isin((ORACLE, FITTED))]
    best = free.groupby("measure", sort=False)["correlation"].mean().idxmax()
    return table.loc[table[table["measure"] == best]["gain"].idxmax()]


def difference(one: Floats, other: Floats, gains: Iterable[Floats]) -> Estimate:
    """Return by how much a measure's mean correlation over arms exceeds another's."""
    pairs = [by_target(one, each.mean(0)) - by_target(other, each.mean(0)) for each in gains]
    return interval(np.mean(pairs, axis=0))
