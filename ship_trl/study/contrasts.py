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
    above,
    below,
    bootstrap,
    holm,
    interquartile_mean,
    no_effect,
    outside,
    probability_of_improvement,
    seen_effect,
    unmeasured,
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


class Claimed(StrEnum):
    """What is claimed of a contrast."""

    above = "above zero"
    alike = "zero, within the margin"
    no_more = "not above the margin"


@dataclass(frozen=True)
class Finding:
    """A contrast measured: positive is the claimed direction.

    `improvement` is the probability that the claimed better side is better, None where the contrast is
    not one of levels (spread, trend, time); `p` is that of no difference, or of none beyond the margin
    where that is claimed; `adjusted` is the same within its figure by Holm's method, once all are known.
    `beyond` is the p of a difference beyond the margin, one where a margin has no meaning. `between` says
    that arms are compared, and not one of them with zero. `deviation` is over seeds, not a number where
    the test is not Student's; `family` is how many contrasts the figure has.
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
    claimed: Claimed = Claimed.above
    between: bool = True
    deviation: float = np.nan
    family: int = 1

    @property
    def as_claimed(self) -> bool:
        """Whether the estimate, however unsure, is what is claimed."""
        value = self.estimate.value
        if self.claimed is Claimed.alike:
            return abs(value) <= MARGIN
        return value > 0 if self.claimed is Claimed.above else value <= MARGIN

    def seen(self, level: float) -> float:
        """The least difference that so many seeds would show four times in five at a level."""
        return seen_effect(self.seeds, level) * self.deviation


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
    claimed: Claimed = Claimed.above,
    resamples: int = RESAMPLES,
    rough: bool = False,
) -> Finding:
    """Measure a weighted sum of arms' interquartile means, above zero as claimed.

    Args:
        claim: the hypothesis's name.
        what: the contrast in words.
        samples: numbers by arm, [S] each, in the order of the seeds.
        weights: by arm; those of the claimed better side are positive.
        seed: of the resampling.
        claimed: what the claim is.
        resamples: how many, of the intervals.
        rough: leave out the intervals where p alone says that no difference will be seen.
    """
    chosen, shares = weighted(samples, weights)

    def total(*values: Sample, axis: int) -> Any:
        return sum(w * interquartile_mean(v, axis) for w, v in zip(shares, values, strict=True))

    better, worse = np.zeros_like(chosen[0]), np.zeros_like(chosen[0])
    for share, values in zip(shares, chosen, strict=True):
        side = better if share > 0 else worse
        side += abs(share) * values
    differences = better - worse
    p, improvement = against(claimed, differences), None
    if rough and p > LEVEL:
        estimate = unmeasured(chosen, total)
    else:
        estimate = bootstrap(chosen, total, seed, resamples)
        improvement = probability_of_improvement(better, worse, seed, resamples)
    ruled_out = below if claimed is Claimed.no_more else within
    return judged(
        Finding(
            claim,
            what,
            estimate,
            improvement,
            p=p,
            adjusted=p,
            seeds=len(differences),
            verdict=Verdict.inconclusive,
            beyond=ruled_out(differences, MARGIN),
            claimed=claimed,
            between=abs(sum(shares)) < SAME,
            deviation=float(np.std(differences, ddof=1)),
        )
    )


def against(claimed: Claimed, differences: Sample) -> float:
    """P of what speaks neither for nor against a claim: no difference, or one within the margin."""
    if claimed is Claimed.above:
        return no_effect(differences)
    return outside(differences, MARGIN) if claimed is Claimed.alike else above(differences, MARGIN)


def found(claim: str, what: str, estimate: Estimate, p: float, seeds: int) -> Finding:
    """A contrast that is not one of levels, with the verdict that it would have if it were the only one."""
    return judged(Finding(claim, what, estimate, None, p, p, seeds, Verdict.inconclusive))


def judged(finding: Finding) -> Finding:
    """The finding with its verdict."""
    if finding.seeds < LEAST_SEEDS:
        return replace(finding, verdict=Verdict.inconclusive)
    rule = judge if finding.claimed is Claimed.above else judge_none
    return replace(finding, verdict=rule(finding))


def inside(finding: Finding) -> bool:
    """Whether a difference beyond the margin is ruled out: on both sides, or of no_more above it."""
    estimate, both = finding.estimate, finding.claimed is not Claimed.no_more
    return (estimate.low >= -MARGIN or not both) and estimate.high <= MARGIN and finding.beyond <= LEVEL


def judge_none(finding: Finding) -> Verdict:
    """The rule for a claim of no difference: within the margin, or beyond it."""
    estimate, both = finding.estimate, finding.claimed is not Claimed.no_more
    if inside(finding):
        return Verdict.supported
    beyond = estimate.low > MARGIN or (both and estimate.high < -MARGIN)
    return Verdict.contradicted if beyond and finding.adjusted <= LEVEL else Verdict.inconclusive


def judge(finding: Finding) -> Verdict:
    """The rule: an interval beyond zero, and one of the probability of improvement beyond a half."""
    estimate, improvement = finding.estimate, finding.improvement
    more = improvement is None or improvement.low > 0.5
    less = improvement is None or improvement.high < 0.5
    if finding.adjusted <= LEVEL and estimate.low > 0 and more:
        return Verdict.supported
    if finding.adjusted <= LEVEL and estimate.high < 0 and less:
        return Verdict.contradicted
    return Verdict.equivalent if inside(finding) else Verdict.inconclusive


def adjust(findings: Sequence[Finding]) -> list[Finding]:
    """Judge the findings of one figure anew, with p-values adjusted for their number."""
    adjusted = holm([finding.p for finding in findings])
    family = len(findings)
    return [judged(replace(f, adjusted=p, family=family)) for f, p in zip(findings, adjusted, strict=True)]


def together(verdicts: Sequence[Verdict], missing: int = 0) -> Verdict:
    """The verdict on a claim of several parts: all must hold, and one that fails contradicts it.

    Parts that are `missing`, for want of runs, leave it open at best.
    """
    if Verdict.contradicted in verdicts:
        return Verdict.contradicted
    if verdicts and not missing and all(v == verdicts[0] for v in verdicts):
        return verdicts[0]
    return Verdict.inconclusive
