"""A contrast between arms: its estimate, its interval, and the p-values that verdicts stand on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from ship_trl.study.analysis.power import seen_effect
from ship_trl.study.analysis.statistics import (
    LEVEL,
    Estimate,
    Sample,
    level_of,
    p_above,
    p_below,
    p_within,
    standard_error,
)

# Two or three seeds cannot show how seeds vary: below this there is no verdict.
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
    no_more = "not above the margin"


@dataclass(frozen=True)
class Finding:
    """A contrast measured: positive is the claimed direction.

    Estimate, interval and p-values are of one quantity: the interquartile mean over seeds of the
    difference within a seed, or the logarithm of a ratio of spreads. All p are one-sided and of this
    contrast alone: `p` that what is claimed is not so, `against` that its opposite is not so, and
    `within` that the difference is beyond the margin (1 where there is none). `error` is the standard
    error, not a number for spreads; `adjusted` is `against` by Holm's method within its figure; `beside`
    is the same contrast by other metrics, which decide nothing. `differences` are those of each seed, in
    order; spreads have none.
    """

    claim: str
    what: str
    metric: str
    estimate: Estimate
    p: float
    against: float
    seeds: int
    claimed: Claimed = Claimed.above
    margin: float | None = None
    within: float = 1.0
    error: float = np.nan
    adjusted: float = 1.0
    verdict: Verdict = Verdict.inconclusive
    beside: Mapping[str, Estimate] = field(default_factory=dict)
    differences: tuple[float, ...] = ()

    @property
    def as_claimed(self) -> bool:
        """Whether the estimate, however unsure, is what is claimed."""
        bound = 0.0 if self.claimed is Claimed.above else (self.margin or 0.0)
        value = self.estimate.value
        return value > 0 if self.claimed is Claimed.above else value <= bound

    def seen(self, level: float = LEVEL / 2) -> float:
        """Return the least difference that so many seeds would show four times in five at a level."""
        return seen_effect(self.seeds, level) * self.error


def contrast(
    claim: str,
    what: str,
    metric: str,
    differences: Sample,
    margin: float | None = None,
    claimed: Claimed = Claimed.above,
    level: float = LEVEL / 2,
) -> Finding:
    """Measure differences by seed [S], above zero as claimed.

    Args:
        claim: the hypothesis's name.
        what: the contrast in words.
        metric: what differs.
        differences: a number a seed; positive is the claimed direction.
        margin: within which a difference counts as none.
        claimed: what the claim is.
        level: one-sided, that the interval leaves out.
    """
    p, against = p_above(differences), p_below(differences)
    if claimed is Claimed.no_more:
        # What is no more than another must not be more by the margin; without one nothing can be said.
        known = margin is not None
        p = p_below(differences, margin) if known else 1.0  # type: ignore[arg-type]
        against = p_above(differences, margin) if known else 1.0  # type: ignore[arg-type]
    return Finding(
        claim,
        what,
        metric,
        level_of(differences, level),
        p,
        against,
        seeds=len(differences),
        claimed=claimed,
        margin=margin,
        within=1.0 if margin is None else p_within(differences, margin),
        error=standard_error(differences)[0],
        differences=tuple(map(float, differences)),
    )
