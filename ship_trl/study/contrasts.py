"""A claim as a contrast between arms, its estimate, and the verdict that follows by rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from ship_trl.study.statistics import (
    Estimate,
    Sample,
    bootstrap,
    holm,
    interquartile_mean,
    probability_of_improvement,
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
    its figure by Holm's method, once all are known. With `alike` the claim is that there is none.
    """

    claim: str
    what: str
    estimate: Estimate
    improvement: Estimate | None
    p: float
    adjusted: float
    seeds: int
    verdict: Verdict
    alike: bool = False


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
) -> Finding:
    """Measure a weighted sum of arms' interquartile means, above zero as claimed.

    Args:
        claim: the hypothesis's name.
        what: the contrast in words.
        samples: numbers by arm, [S] each, in the order of the seeds.
        weights: by arm; those of the claimed better side are positive.
        seed: of the resampling.
        alike: the claim is that the sum is zero, within the margin.
    """
    chosen, shares = weighted(samples, weights)

    def total(*values: Sample, axis: int) -> Any:
        return sum(w * interquartile_mean(v, axis) for w, v in zip(shares, values, strict=True))

    estimate = bootstrap(chosen, total, seed)
    better, worse = np.zeros_like(chosen[0]), np.zeros_like(chosen[0])
    for share, values in zip(shares, chosen, strict=True):
        side = better if share > 0 else worse
        side += abs(share) * values
    improvement = probability_of_improvement(better, worse, seed)
    return found(claim, what, estimate, improvement, estimate.p, len(chosen[0]), alike)


def found(
    claim: str,
    what: str,
    estimate: Estimate,
    improvement: Estimate | None,
    p: float,
    seeds: int,
    alike: bool = False,
) -> Finding:
    """A finding with the verdict that it would have if it were the only one."""
    return judged(Finding(claim, what, estimate, improvement, p, p, seeds, Verdict.inconclusive, alike))


def judged(finding: Finding) -> Finding:
    """The finding with its verdict."""
    if finding.seeds < LEAST_SEEDS:
        return replace(finding, verdict=Verdict.inconclusive)
    if finding.alike:
        return replace(finding, verdict=judge_alike(finding.estimate, finding.adjusted))
    return replace(finding, verdict=judge(finding.estimate, finding.improvement, finding.adjusted))


def judge_alike(estimate: Estimate, adjusted: float) -> Verdict:
    """The rule for a claim of no difference: within the margin, or beyond it."""
    if estimate.low >= -MARGIN and estimate.high <= MARGIN:
        return Verdict.supported
    if adjusted <= LEVEL and (estimate.low > MARGIN or estimate.high < -MARGIN):
        return Verdict.contradicted
    return Verdict.inconclusive


def judge(estimate: Estimate, improvement: Estimate | None, adjusted: float) -> Verdict:
    """The rule: an interval beyond zero, and one of the probability of improvement beyond a half."""
    above = improvement is None or improvement.low > 0.5
    below = improvement is None or improvement.high < 0.5
    if adjusted <= LEVEL and estimate.low > 0 and above:
        return Verdict.supported
    if adjusted <= LEVEL and estimate.high < 0 and below:
        return Verdict.contradicted
    if estimate.low >= -MARGIN and estimate.high <= MARGIN:
        return Verdict.equivalent
    return Verdict.inconclusive


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
