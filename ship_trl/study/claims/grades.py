"""Grades of claims: what the parts of a claim show, by the rule in docs/study.md (Grades).

A part is a contrast of a claim. Grades decide nothing; verdicts follow docs/analysis-plan.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from ship_trl.study.claims.kinds import Hypothesis
from ship_trl.study.claims.verdicts import ALL, counts
from ship_trl.study.compare import Claimed, Finding
from ship_trl.study.statistics import LEVEL, holm, p_below
from ship_trl.study.study import Study


class Grade(StrEnum):
    """What the parts of a claim show together."""

    supported = "supported"
    leaning_for = "leaning for"
    mixed = "mixed"
    leaning_against = "leaning against"
    contradicted = "contradicted"
    size_excluded = "size excluded"
    undetermined = "undetermined"


class Part(StrEnum):
    """What a part of a claim shows."""

    supports = "for"
    opposes = "against"
    size_excluded = "size excluded"
    open = "open"


@dataclass(frozen=True)
class Evidence:
    """The one-sided p-values of a part.

    `p` is for the claim, `against` for its opposite, and `small` for an effect below the margin; it is None
    for a part without a margin, and for one that claims no more than the margin.
    """

    p: float
    against: float
    small: float | None = None


@dataclass(frozen=True)
class Graded:
    """The grade of a claim, and what each of its parts shows, by the words of its contrast."""

    grade: Grade = Grade.undetermined
    parts: Mapping[str, Part] = field(default_factory=dict)


def grade_all(study: Study, hypotheses: Sequence[Hypothesis] = ALL) -> dict[str, Graded]:
    """Grade claims by their names."""
    return {name: grade(findings) for name, findings in measure_parts(study, hypotheses).items()}


def measure_parts(study: Study, hypotheses: Sequence[Hypothesis] = ALL) -> dict[str, list[Finding]]:
    """Measure the parts of claims by name, over all seeds up to the last whole look.

    A claim has no parts here if one of them lacks seeds.
    """
    seeds = study.whole_looks[-1]
    seen = study.first(seeds, LEVEL / 2)
    measured = {}
    for claim in hypotheses:
        found = [finding for test in claim.tests for finding in test(seen)]
        is_whole = len(found) == len(claim.tests) and all(counts(one, seeds) for one in found)
        measured[claim.name] = found if is_whole else []
    return measured


def grade(findings: Sequence[Finding]) -> Graded:
    """Grade a claim by its parts; without parts it is undetermined."""
    evidence = [evidence_of(found) for found in findings]
    parts = grade_parts(evidence)
    names = [found.what for found in findings]
    return Graded(grade_claim(evidence, parts), dict(zip(names, parts, strict=True)))


def evidence_of(finding: Finding) -> Evidence:
    """Return the p-values of a contrast."""
    has_size = finding.margin is not None and finding.claimed is Claimed.above
    small = p_below(np.array(finding.differences), finding.margin or 0.0) if has_size else None
    return Evidence(finding.p, finding.against, small)


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
