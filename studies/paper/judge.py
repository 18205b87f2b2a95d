"""Verdicts on claims, by the rules of analysis-plan.md, and their grades, by the rule of grades.md.

A claim is supported at the largest p-value of its contrasts (intersection-union test), adjusted by Holm's
method over the claims of its figure. It is contradicted by one contrast in the opposite direction, adjusted
over all contrasts of the figure. A study is judged after every five seeds, at O'Brien and Fleming's levels; a
decision at a look is final. A grade says what the contrasts of a claim show, and decides nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy import optimize, special, stats

from ship_trl.study.compare import MIN_SEEDS
from ship_trl.study.statistics import LEVEL, Estimate, degrees_of_freedom
from ship_trl.study.study import Study
from studies.p_values import holm, p_below
from studies.paper.contrasts import MAX_PERMUTATIONS, Claimed, Test

CONCLUSION, EXPLORATORY = "conclusions", "exploratory"
# The seeds that an open claim is said to need may fail to decide it this often.
MAX_FAILURE = 0.2
# O'Brien and Fleming's constants for 1 to 5 looks at a two-sided level of 0.05 (Jennison and Turnbull,
# 2000, table 2.3): at look k of K the critical z is the constant times the root of K / k.
OBRIEN_FLEMING = (1.960, 1.977, 2.004, 2.024, 2.040)
# Numbers of seeds to try: whole blocks, coarser as they grow.
SEED_COUNTS = (*range(5, 100, 5), *range(100, 300, 20), *range(300, 1001, 100))


class Verdict(StrEnum):
    """What the runs say about a claim."""

    supported = "supported"
    contradicted = "contradicted"
    equivalent = "equivalent"
    inconclusive = "inconclusive"


class Grade(StrEnum):
    """What the contrasts of a claim show together."""

    supported = "supported"
    leaning_for = "leaning for"
    mixed = "mixed"
    leaning_against = "leaning against"
    contradicted = "contradicted"
    size_excluded = "size excluded"
    undetermined = "undetermined"


class Part(StrEnum):
    """What a contrast shows of its claim."""

    supports = "for"
    opposes = "against"
    size_excluded = "size excluded"
    open = "open"


@dataclass(frozen=True)
class Claim:
    """A claim, judged with those of its figure; it holds if all its contrasts hold."""

    name: str
    figure: str
    sentence: str
    tests: Sequence[Test]


@dataclass(frozen=True)
class Finding:
    """A measured contrast, what is claimed of it, and the verdict on it alone.

    `adjusted` is its p-value for the opposite, by Holm's method over all contrasts of the figure.
    """

    found: Estimate
    claimed: Claimed = Claimed.above
    adjusted: float = 1.0
    verdict: Verdict = Verdict.inconclusive

    @property
    def as_claimed(self) -> bool:
        """Whether the estimate, however uncertain, agrees with the claim."""
        value = self.found.value
        return value > 0 if self.claimed is Claimed.above else value <= (self.found.margin or 0.0)

    def min_detectable(self, level: float) -> float:
        """Return the least difference that these seeds detect four times in five at a level."""
        return min_detectable_effect(self.found.seeds, level) * self.found.error

    def counts(self, seeds: int | None) -> bool:
        """Return whether the contrast has the seeds that a look needs, or at least five if that is None."""
        return self.found.seeds >= MIN_SEEDS and seeds in (None, self.found.seeds)


@dataclass(frozen=True)
class Answer:
    """A claim, measured at the look that decided it, or at the last whole look.

    `p` is the adjusted p-value behind the verdict; for an open claim that of support. `seeds` and `level` are
    those of the look; `missing` contrasts lack seeds there. `decided` is the number of seeds at the verdict,
    0 for an open claim. `claims` is the number of claims of the figure.
    """

    claim: Claim
    findings: list[Finding]
    verdict: Verdict = Verdict.inconclusive
    p: float = 1.0
    missing: int = 0
    seeds: int = 0
    level: float = LEVEL / 2
    decided: int = 0
    claims: int = 1

    @property
    def word(self) -> str:
        """The verdict, or "no runs"."""
        return self.verdict.value if self.findings else "no runs"

    def seeds_wanted(self) -> int | None:
        """Return how many seeds of a study with one look would decide an open claim four times in five.

        This holds if each contrast is as large as its margin, or zero; differences in between may need any
        number. The estimates are not used, because they are what left the claim open. Return None if the
        claim is decided, a contrast has no margin or standard error, or a thousand seeds are too few.
        """
        if self.decided or not self.findings or len(self.findings) < len(self.claim.tests):
            return None
        # All contrasts together, each from both sides, may fail as often as one.
        power = 1 - MAX_FAILURE / (2 * len(self.findings))
        level = LEVEL / 2 / self.claims
        measured = [one.found for one in self.findings]
        needed = [seeds_needed(one.margin or 0.0, one.error, one.seeds, level, power) for one in measured]
        return None if None in needed else max(count or 0 for count in needed)


class Evidence(NamedTuple):
    """The one-sided p-values of a contrast.

    `p` is for the claim, `against` for its opposite, and `small` for an effect below the margin; it is None
    for a contrast without a margin, and for one that claims no more than the margin.
    """

    p: float
    against: float
    small: float | None = None


class Graded(NamedTuple):
    """The grade of a claim, and what each of its contrasts shows, by its words."""

    grade: Grade
    parts: Mapping[str, Part]


def judge_all(study: Study, claims: Sequence[Claim]) -> list[Answer]:
    """Judge claims at each whole look; the claims of a figure are judged together.

    An open claim has the numbers of the last whole look, or of all seeds before the first look.
    """
    figures = dict.fromkeys(claim.figure for claim in claims)
    families = [[claim for claim in claims if claim.figure == figure] for figure in figures]
    decided: dict[str, Answer] = {}
    answers: list[Answer] = []
    for number, count in enumerate(study.whole_looks, 1):
        level = look_level(number, len(study.looks))
        seen = study.first(count, level)
        answers = [found for family in families for found in judge(seen, family, count, level)]
        for found in answers:
            if found.decided:
                decided.setdefault(found.claim.name, found)
    return [decided.get(found.claim.name, found) for found in answers]


def explore(study: Study, claims: Sequence[Claim]) -> list[Answer]:
    """Judge each of some claims alone, on the seeds of the last whole look."""
    seen = study.first(study.whole_looks[-1], LEVEL / 2)
    return [judge(seen, [claim], None, LEVEL / 2)[0] for claim in claims]


def judge(study: Study, family: Sequence[Claim], seeds: int | None, level: float) -> list[Answer]:
    """Judge the claims of a figure together.

    A contrast counts if it has `seeds` seeds, or at least five if that is None. The level is one-sided.
    """
    measured = [measure(study, claim) for claim in family]
    # Holm's method counts the planned contrasts, also those that lack runs.
    planned = sum(len(claim.tests) for claim in family)
    against = [one.found.against if one.counts(seeds) else 1.0 for findings in measured for one in findings]
    adjusted = iter(holm(against + [1.0] * (planned - len(against))))
    support, equality = [], []
    for k, (claim, findings) in enumerate(zip(family, measured, strict=True)):
        measured[k] = [judge_alone(replace(one, adjusted=next(adjusted)), seeds, level) for one in findings]
        is_whole = len(findings) == len(claim.tests) and all(one.counts(seeds) for one in findings)
        support.append(max(one.found.p for one in findings) if is_whole else 1.0)
        are_differences = is_whole and all(one.claimed is Claimed.above for one in findings)
        equality.append(max(one.found.within for one in findings) if are_differences else 1.0)
    answers = []
    for claim, findings, p, within in zip(family, measured, holm(support), holm(equality), strict=True):
        opposite = min((one.adjusted for one in findings), default=1.0)
        verdict = decide(p, opposite, within, level)
        count = seeds or max((one.found.seeds for one in findings), default=0)
        answers.append(
            Answer(
                claim,
                findings,
                verdict,
                {Verdict.contradicted: opposite, Verdict.equivalent: within}.get(verdict, p),
                missing=len(claim.tests) - sum(one.counts(seeds) for one in findings),
                seeds=count,
                level=level,
                decided=0 if verdict is Verdict.inconclusive else count,
                claims=len(family),
            )
        )
    return answers


def measure(study: Study, claim: Claim, permutations: int = MAX_PERMUTATIONS) -> list[Finding]:
    """Measure the contrasts of a claim; those with fewer than two seeds are left out."""
    found = ((test.measure(study, permutations), test.claimed) for test in claim.tests)
    return [Finding(one, claimed) for one, claimed in found if one is not None]


def decide(support: float, opposite: float, within: float, level: float) -> Verdict:
    """Return the verdict that three p-values give at a level."""
    if support <= level:
        return Verdict.supported
    if opposite <= level:
        return Verdict.contradicted
    return Verdict.equivalent if within <= level else Verdict.inconclusive


def judge_alone(one: Finding, seeds: int | None, level: float) -> Finding:
    """Add the verdict on a contrast alone: only its opposite is adjusted."""
    if not one.counts(seeds):
        return one
    within = one.found.within if one.claimed is Claimed.above else 1.0
    return replace(one, verdict=decide(one.found.p, one.adjusted, within, level))


def grade_all(
    study: Study, claims: Sequence[Claim], permutations: int = MAX_PERMUTATIONS
) -> dict[str, Graded]:
    """Grade claims by their names."""
    return {name: grade(found) for name, found in measure_parts(study, claims, permutations).items()}


def measure_parts(
    study: Study, claims: Sequence[Claim], permutations: int = MAX_PERMUTATIONS
) -> dict[str, list[Finding]]:
    """Measure the contrasts of claims by name, over all seeds up to the last whole look.

    A claim has none here if one of them lacks seeds.
    """
    seeds = study.whole_looks[-1]
    seen = study.first(seeds, LEVEL / 2)
    measured = {}
    for claim in claims:
        found = measure(seen, claim, permutations)
        is_whole = len(found) == len(claim.tests) and all(one.counts(seeds) for one in found)
        measured[claim.name] = found if is_whole else []
    return measured


def grade(findings: Sequence[Finding]) -> Graded:
    """Grade a claim by its contrasts; without any it is undetermined."""
    evidence = []
    for one in findings:
        found, margin = one.found, one.found.margin
        has_size = margin is not None and one.claimed is Claimed.above
        small = p_below(np.array(found.differences), margin or 0.0) if has_size else None
        evidence.append(Evidence(found.p, found.against, small))
    parts = grade_parts(evidence)
    names = [one.found.what for one in findings]
    return Graded(grade_claim(evidence, parts), dict(zip(names, parts, strict=True)))


def grade_parts(evidence: Sequence[Evidence]) -> list[Part]:
    """Return what each part of a claim shows, with Holm's method over the parts that have the p-value."""
    small = iter(holm([one.small for one in evidence if one.small is not None]))
    rows = zip(evidence, holm([one.p for one in evidence]), holm([e.against for e in evidence]), strict=True)
    parts = []
    for one, p, against in rows:
        size = next(small) if one.small is not None else 1.0
        words = ((p, Part.supports), (against, Part.opposes), (size, Part.size_excluded))
        parts.append(next((part for value, part in words if value <= LEVEL / 2), Part.open))
    return parts


def grade_claim(evidence: Sequence[Evidence], parts: Sequence[Part]) -> Grade:
    """Return the grade of a claim whose parts show `parts`."""
    count = Counter(parts)
    if count[Part.supports]:
        if count[Part.supports] == len(parts):
            return Grade.supported
        return Grade.mixed if count[Part.opposes] else Grade.leaning_for
    if count[Part.opposes]:
        return Grade.contradicted if 2 * count[Part.opposes] >= len(parts) else Grade.leaning_against
    sized = [part for one, part in zip(evidence, parts, strict=True) if one.small is not None]
    is_excluded = sized and all(part is Part.size_excluded for part in sized)
    return Grade.size_excluded if is_excluded else Grade.undetermined


def count_grades(grades: Sequence[Grade]) -> dict[Grade, int]:
    """Count the claims of each grade, in the order of `Grade`."""
    return {grade: sum(one is grade for one in grades) for grade in Grade}


def look_level(look: int, looks: int) -> float:
    """Return the one-sided level of a look, from 1 to `looks`; all looks together err in 2.5 % a side."""
    return float(stats.norm.sf(OBRIEN_FLEMING[looks - 1] * sqrt(looks / look)))


@cache
def min_detectable_effect(seeds: int, level: float = LEVEL / 2, power: float = 0.8) -> float:
    """Return the least effect, in standard errors, that a one-sided t-test detects with this power.

    The power is a mean over quantiles of a chi distribution, because SciPy's noncentral t fails for few seeds
    and low levels.
    """
    freedom = degrees_of_freedom(seeds)
    if freedom <= 0:
        return np.inf
    quantiles = (np.arange(4_000) + 0.5) / 4_000
    chi = np.sqrt(stats.chi2.ppf(quantiles, freedom) / freedom)
    critical = stats.t.isf(level, freedom)

    def missing_power(effect: float) -> float:
        return float(np.mean(special.ndtr(effect - critical * chi)) - power)

    return float(optimize.brentq(missing_power, 0.0, 1e9))


def seeds_needed(difference: float, error: float, seeds: int, level: float, power: float) -> int | None:
    """Return how many seeds detect a difference; None if the error is unknown or 1,000 seeds are too few.

    `error` is the standard error with `seeds` seeds; it falls with the root of their number.
    """
    if not error > 0:
        return None
    # The root of an estimated variance is too small on average.
    error /= 1 - 1 / (4 * degrees_of_freedom(seeds))
    for count in SEED_COUNTS:
        if min_detectable_effect(count, level, power) * error * (seeds / count) ** 0.5 <= difference:
            return count
    return None
