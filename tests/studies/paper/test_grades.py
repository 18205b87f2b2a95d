"""Grades by the rule of grades.md, each on a toy that must have it."""

from dataclasses import replace

import numpy as np
import pytest

from ship_trl.study.manifest import NO_PLAN
from ship_trl.study.statistics import Estimate, estimate_mean
from studies.paper.claims import ALL
from studies.paper.contrasts import Claimed, add_p_values, beats
from studies.paper.judge import (
    Claim,
    Evidence,
    Finding,
    Grade,
    Part,
    grade,
    grade_all,
    grade_claim,
    grade_parts,
)
from tests.study.synthetic import make_study

FOR, AGAINST, OPEN = Evidence(0.001, 0.999), Evidence(0.999, 0.001), Evidence(0.4, 0.6)
SMALL, UNSURE = Evidence(0.4, 0.6, 0.001), Evidence(0.4, 0.6, 0.4)


def graded(*evidence: Evidence) -> Grade:
    return grade_claim(evidence, grade_parts(evidence))


TOYS = [
    ([FOR, FOR], Grade.supported),
    ([FOR, OPEN, SMALL], Grade.leaning_for),
    ([FOR, AGAINST, OPEN], Grade.mixed),
    ([AGAINST, OPEN, OPEN], Grade.leaning_against),
    ([AGAINST, OPEN], Grade.contradicted),
    ([AGAINST, AGAINST, SMALL], Grade.contradicted),
    ([SMALL, SMALL], Grade.size_excluded),
    # A part without a margin does not count there; without any margin nothing is excluded.
    ([SMALL, OPEN], Grade.size_excluded),
    ([SMALL, UNSURE], Grade.undetermined),
    ([OPEN, OPEN], Grade.undetermined),
    ([], Grade.undetermined),
]


@pytest.mark.parametrize(("parts", "expected"), TOYS)
def test_parts_make_a_grade(parts: list[Evidence], expected: Grade) -> None:
    assert graded(*parts) is expected


def test_holms_method_is_within_the_claim() -> None:
    # 0.02 is below the level alone, and 0.04 beside another part.
    alone, twice = [Evidence(0.02, 0.98)], [Evidence(0.02, 0.98), Evidence(0.9, 0.1)]
    assert grade_parts(alone) == [Part.supports] and grade_parts(twice) == [Part.open, Part.open]
    assert grade_parts([Evidence(0.98, 0.02), Evidence(0.9, 0.1)]) == [Part.open, Part.open]
    # A size is adjusted over the parts that have one.
    size = Evidence(0.5, 0.5, 0.02)
    assert grade_parts([size, OPEN]) == [Part.size_excluded, Part.open]
    assert grade_parts([size, UNSURE]) == [Part.open, Part.open]
    # Step down: after the smallest, the next is adjusted less.
    assert grade_parts([Evidence(0.001, 1), Evidence(0.02, 1)]) == [Part.supports, Part.supports]


@pytest.mark.parametrize("seed", range(20))
def test_a_claim_of_which_all_parts_are_sure_is_supported_and_its_opposite_contradicted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 20))
    tiny, sizes = rng.random(count) * 0.025 / count, rng.random(count)
    evidence = [
        Evidence(float(p), 1 - float(p), None if q < 0.3 else float(q))
        for p, q in zip(tiny, sizes, strict=True)
    ]
    assert graded(*evidence) is Grade.supported
    opposite = [one._replace(p=one.against, against=one.p) for one in evidence]
    assert graded(*opposite) is Grade.contradicted


def finding(mean: float, sd: float, claimed: Claimed = Claimed.above, margin: float | None = 0.1) -> Finding:
    values = mean + sd * np.linspace(-1, 1, 15)
    found = replace(estimate_mean(values), what=f"{mean} {sd}", differences=tuple(values.tolist()))
    return Finding(add_p_values(found, claimed, margin), claimed)


def test_parts_are_measured_on_differences() -> None:
    def shows(one: Finding) -> Part:
        (part,) = grade([one]).parts.values()
        return part

    assert shows(finding(0.2, 0.1)) is Part.supports and shows(finding(-0.2, 0.1)) is Part.opposes
    assert shows(finding(0.0, 0.1)) is Part.size_excluded and shows(finding(0.0, 0.4)) is Part.open
    assert shows(finding(0.0, 0.1, margin=None)) is Part.open
    # A claim of no more than the margin is for at zero, against far above it, and never of a size.
    assert shows(finding(0.0, 0.1, Claimed.no_more)) is Part.supports
    assert shows(finding(0.3, 0.1, Claimed.no_more)) is Part.opposes
    assert shows(finding(0.1, 0.1, Claimed.no_more)) is Part.open


def test_a_spread_is_for_or_against_and_excludes_no_size() -> None:
    def spread(p: float, against: float) -> Finding:
        return Finding(Estimate(0.5, 0.1, 0.9, 15, "a", "spread", p, against))

    assert grade([spread(0.01, 0.99)]).grade is Grade.supported
    assert grade([spread(0.99, 0.01)]).grade is Grade.contradicted
    assert grade([spread(0.5, 0.5)]).grade is Grade.undetermined
    # Beside it a size may be excluded.
    assert grade([spread(0.5, 0.5), finding(0.0, 0.1)]).grade is Grade.size_excluded


def high(**ends: float) -> dict[tuple[str, str, str], float]:
    return {("pairs", "high", arm): end for arm, end in ends.items()}


def test_grades_are_over_all_judged_seeds_and_not_those_of_the_look_that_decided() -> None:
    claims = [Claim("A", "5", "", [beats("high", "FE1", "FE2")])]
    study = replace(make_study(high(FE1=0.9, FE2=0.3), sd=0.002), plan=replace(NO_PLAN, judged=[*range(15)]))
    assert grade_all(study, claims)["A"].grade is Grade.supported
    # From the sixth seed on the arms change places: 10 of 15 seeds are the other way.
    for seed in range(5, 15):
        one, other = (("pairs", "high", arm, seed) for arm in ("FE1", "FE2"))
        study.records[one], study.records[other] = study.records[other], study.records[one]
    assert grade_all(study.first(5, 0.025), claims)["A"].grade is Grade.supported
    assert grade_all(study, claims)["A"].grade is not Grade.supported
    # Seeds of a look that is not whole are not graded.
    assert grade_all(study.first(9, 0.025), claims)["A"].grade is Grade.supported


def test_a_claim_whose_parts_lack_seeds_is_undetermined() -> None:
    study = make_study(high(FE1=0.9, FE2=0.3, FE3=0.3))
    claims = [Claim("A", "5", "", [beats("high", "FE1", other) for other in ("FE2", "FE3")])]
    assert grade_all(study, claims)["A"].grade is Grade.supported
    del study.records["pairs", "high", "FE3", 14]
    lacking = grade_all(study, claims)["A"]
    assert lacking.grade is Grade.undetermined and lacking.parts == {}
    nothing = grade_all(make_study(high(scratch=0.5)), ALL)
    assert {one.grade for one in nothing.values()} == {Grade.undetermined} and len(nothing) == len(ALL)
