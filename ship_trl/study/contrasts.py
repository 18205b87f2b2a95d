"""A claim as a contrast between arms, its estimate, and the verdict that follows by rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from ship_trl.study.statistics import (
    RESAMPLES,
    SAME,
    Estimate,
    Sample,
    bootstrap,
    holm,
    interquartile_mean,
    no_effect,
    probability_of_improvement,
    seen_effect,
    within,
)

# Of a score: less than a twentieth of the way from random to best is called no difference.
MARGIN = 0.05
LEVEL = 0.05
# Resampling two or three seeds cannot show how seeds vary: below this there is no verdict.
LEAST_SEEDS = 5


class Verdict(StrEnum):
    """What was measured of a claim."""

    supported = "supported"
    contradicted = "contradicted"
    equivalent = "equivalent"
    inconclusive = "inconclusive"


@dataclass(frozen=True)
class Finding:
    """A contrast measured: positive is the claimed direction.

    `improvement` is the probability that the claimed better side is better, None where the contrast is
    not one of levels (spread, trend, time); `p` is that of no difference, `adjusted` the same within
    its figure by Holm's method, once all are known; `beyond` is the p of a difference beyond the margin,
    one where that has no meaning. With `alike` the claim is that there is none; `between` says that
    arms are compared, and not one of them with zero. `seen` is the least difference that so many seeds
    would show four times in five, if it were the only contrast; not a number for spread.
    """

    claim: str
    what: str
    estimate: Estimate
    improvement: Estimate | None
    p: float
    adjusted: float
    seeds: int
    verdict: Verdict
    beyond: float = 1.0
    alike: bool = False
    between: bool = True
    seen: float = np.nan


def weighted(samples: Mapping[str, Sample], weights: Mapping[str, float]) -> tuple[list[Sample], list[float]]:
    """The samples that have a weight, in order, with it."""
    names = [name for name in sorted(weights) if weights[name] != 0]
    return [samples[name] for name in names], [weights[name] for name in names]


def contrast(
    claim: str,
    what: str,
    samples: Mapping[str, Sample],
    weights: Mapping[str, float],
    seed: int,
    alike: bool = False,
    resamples: int = RESAMPLES,
) -> Finding:
    """Measure a weighted sum of arms' interquartile means, above zero as claimed.

    Args:
        claim: the hypothesis's name.
        what: the contrast in words.
        samples: numbers by arm, [S] each, in the order of the seeds.
        weights: by arm; those of the claimed better side are positive.
        seed: of the resampling.
        alike: the claim is that the sum is zero, within the margin.
        resamples: how many, of the intervals.
    """
    chosen, shares = weighted(samples, weights)

    def total(*values: Sample, axis: int) -> Any:
        return sum(w * interquartile_mean(v, axis) for w, v in zip(shares, values, strict=True))

    estimate = bootstrap(chosen, total, seed, resamples)
    better, worse = np.zeros_like(chosen[0]), np.zeros_like(chosen[0])
    for share, values in zip(shares, chosen, strict=True):
        side = better if share > 0 else worse
        side += abs(share) * values
    improvement = probability_of_improvement(better, worse, seed, resamples)
    p = no_effect(better - worse)
    between = abs(sum(shares)) < SAME
    return found(claim, what, estimate, improvement, p, better - worse, alike, between)


def found(
    claim: str,
    what: str,
    estimate: Estimate,
    improvement: Estimate | None,
    p: float,
    differences: Sample,
    alike: bool = False,
    between: bool = True,
) -> Finding:
    """A finding with the verdict that it would have if it were the only one.

    `differences` are the contrast by seed; not numbers where it is none of single seeds (spread).
    """
    beyond = within(differences, MARGIN) if np.isfinite(differences).all() else 1.0
    seeds = len(differences)
    seen = float(seen_effect(seeds) * np.std(differences, ddof=1))
    open_ = Verdict.inconclusive
    return judged(
        Finding(claim, what, estimate, improvement, p, p, seeds, open_, beyond, alike, between, seen)
    )


def judged(finding: Finding) -> Finding:
    """The finding with its verdict."""
    if finding.seeds < LEAST_SEEDS:
        return replace(finding, verdict=Verdict.inconclusive)
    return replace(finding, verdict=judge_alike(finding) if finding.alike else judge(finding))


def inside(finding: Finding) -> bool:
    """Whether a difference beyond the margin is ruled out."""
    estimate = finding.estimate
    return estimate.low >= -MARGIN and estimate.high <= MARGIN and finding.beyond <= LEVEL


def judge_alike(finding: Finding) -> Verdict:
    """The rule for a claim of no difference: within the margin, or beyond it."""
    estimate = finding.estimate
    if inside(finding):
        return Verdict.supported
    if finding.adjusted <= LEVEL and (estimate.low > MARGIN or estimate.high < -MARGIN):
        return Verdict.contradicted
    return Verdict.inconclusive


def judge(finding: Finding) -> Verdict:
    """The rule: an interval beyond zero, and one of the probability of improvement beyond a half."""
    estimate, improvement = finding.estimate, finding.improvement
    above = improvement is None or improvement.low > 0.5
    below = improvement is None or improvement.high < 0.5
    if finding.adjusted <= LEVEL and estimate.low > 0 and above:
        return Verdict.supported
    if finding.adjusted <= LEVEL and estimate.high < 0 and below:
        return Verdict.contradicted
    return Verdict.equivalent if inside(finding) else Verdict.inconclusive


def adjust(findings: Sequence[Finding]) -> list[Finding]:
    """Judge the findings of one figure anew, with p-values adjusted for their number."""
    adjusted = holm([finding.p for finding in findings])
    return [judged(replace(f, adjusted=p)) for f, p in zip(findings, adjusted, strict=True)]


def together(verdicts: Sequence[Verdict]) -> Verdict:
    """The verdict on a claim of several parts: all must hold, and one that fails contradicts it."""
    if not verdicts:
        return Verdict.inconclusive
    if all(v == verdicts[0] for v in verdicts):
        return verdicts[0]
    return Verdict.contradicted if Verdict.contradicted in verdicts else Verdict.inconclusive
