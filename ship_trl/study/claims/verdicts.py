"""Verdicts: which of the paper's claims hold, by the rules of docs/analysis-plan.md.

A claim is a conjunction, so that it is supported at the largest p of its contrasts, with nothing
adjusted among them (intersection-union test); Holm's method adjusts over the claims of a figure. One
contrast that is surely the other way contradicts it; there Holm's method is over all contrasts of the
figure. A study is looked at after every five seeds, by O'Brien and Fleming's levels; what a look decides
stays decided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ship_trl.study.analysis.contrasts import LEAST_SEEDS, Claimed, Finding, Verdict
from ship_trl.study.analysis.power import seeds_needed
from ship_trl.study.analysis.statistics import LEVEL, holm, look_level
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.conclusions import CONCLUSIONS, OURS
from ship_trl.study.claims.hypotheses import HYPOTHESES
from ship_trl.study.claims.kinds import Hypothesis

ALL = [*CONCLUSIONS, *HYPOTHESES]
# How often so many seeds as a claim wants may fail to decide it.
MISSED = 0.2


@dataclass(frozen=True)
class Answer:
    """A claim measured at the look that decided it, or at the last one that was reached.

    `p` is what the verdict stands on, adjusted: of contradiction over the figure's contrasts, else over
    its claims, and that of support while the claim is open. `missing` is how many of its contrasts lack
    seeds at that look of `seeds`, whose one-sided level is `level`; `decided` after how many the verdict
    fell, 0 while the claim is open; `claims` how many its figure has.
    """

    hypothesis: Hypothesis
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
        """The verdict for people; a claim of which nothing could be measured has none."""
        return self.verdict.value if self.findings else "no runs"

    def wanted(self) -> int | None:
        """Return how many seeds of a study with one look would decide an open claim four times in five.

        That is, if each of its contrasts is as large as its margin, or nothing; of what lies between, no
        number of seeds is sure. What was estimated of the contrasts is not asked, for it is chance that it
        stayed open with. None if a thousand would not do, if a contrast has no margin or no standard error,
        or if the claim is decided. Adjusted over the figure's claims as Bonferroni does, a little too much.
        """
        if self.decided or len(self.findings) < len(self.hypothesis.tests):
            return None
        # All contrasts at once, each from both sides, may miss as often as one.
        power = 1 - MISSED / (2 * len(self.findings))
        needed = [
            seeds_needed(f.margin or 0.0, f.error, f.seeds, LEVEL / 2 / self.claims, power)
            for f in self.findings
        ]
        known = [count for count in needed if count is not None]
        return max(known) if known and len(known) == len(needed) else None


def as_planned(finding: Finding) -> Finding:
    """Return what was measured of a contrast, tested as the plan has it."""
    return finding


def answer(
    study: Study, hypotheses: Sequence[Hypothesis] = ALL, tested: Callable[[Finding], Finding] = as_planned
) -> list[Answer]:
    """Judge claims at each look that the study's seeds allow; a figure's are judged together.

    What is open is told of the last look that was reached, for seeds beyond it are not looked at yet; before
    the first look, of the seeds that there are. `tested` may put other p-values in the place of the plan's.
    """
    decided: dict[str, Answer] = {}
    answers: list[Answer] = []
    for number, count in enumerate(reached(study), 1):
        level = look_level(number, len(study.looks))
        seen = study.first(count, level)
        answers = [
            found for family in families(hypotheses) for found in judge(seen, family, count, level, tested)
        ]
        for found in answers:
            if found.decided:
                decided.setdefault(found.hypothesis.name, found)
    return [decided.get(found.hypothesis.name, found) for found in answers]


def reached(study: Study) -> tuple[int, ...]:
    """Return the looks of which all seeds have runs; the first is reached with whatever seeds there are."""
    begun = {key[3] for key in study.records}
    first, *others = study.looks
    return (first, *(count for count in others if begun.issuperset(study.seeds[:count])))


def explore(study: Study) -> list[Answer]:
    """Judge each of our own contrasts alone, on the seeds of the last look: it explains and decides nothing.

    Between looks nothing is judged. A contrast may have fewer seeds, where the plan gives it no more.
    """
    seen = study.first(reached(study)[-1], LEVEL / 2)
    return [judge(seen, [hypothesis], None, LEVEL / 2)[0] for hypothesis in OURS]


def families(hypotheses: Sequence[Hypothesis]) -> list[list[Hypothesis]]:
    """Return claims by figure, in order."""
    figures = dict.fromkeys(h.figure for h in hypotheses)
    return [[h for h in hypotheses if h.figure == figure] for figure in figures]


def judge(
    study: Study,
    family: Sequence[Hypothesis],
    seeds: int | None,
    level: float,
    tested: Callable[[Finding], Finding] = as_planned,
) -> list[Answer]:
    """Judge the claims of a figure together at a one-sided level.

    A contrast counts if it has `seeds` seeds; None takes as many as there are, at least five.
    """
    measured = [
        [tested(finding) for test in hypothesis.tests for finding in test(study, hypothesis.name)]
        for hypothesis in family
    ]
    # A figure has as many claims and contrasts as the plan gives it, also while some lack runs.
    planned = sum(len(hypothesis.tests) for hypothesis in family)
    against = [f.against if counts(f, seeds) else 1.0 for findings in measured for f in findings]
    adjusted = iter(holm(against + [1.0] * (planned - len(against))))
    measured = [[replace(f, adjusted=next(adjusted)) for f in findings] for findings in measured]
    support, equality = [], []
    for hypothesis, findings in zip(family, measured, strict=True):
        whole = len(findings) == len(hypothesis.tests) and all(counts(f, seeds) for f in findings)
        support.append(max(f.p for f in findings) if whole else 1.0)
        differences = whole and all(f.claimed is Claimed.above for f in findings)
        equality.append(max(f.within for f in findings) if differences else 1.0)
    answers = []
    for hypothesis, findings, p, same in zip(family, measured, holm(support), holm(equality), strict=True):
        opposite = min((f.adjusted for f in findings), default=1.0)
        verdict, stands_on = Verdict.inconclusive, p
        if p <= level:
            verdict = Verdict.supported
        elif opposite <= level:
            verdict, stands_on = Verdict.contradicted, opposite
        elif same <= level:
            verdict, stands_on = Verdict.equivalent, same
        count = seeds or max((f.seeds for f in findings), default=0)
        answers.append(
            Answer(
                hypothesis,
                [replace(f, verdict=alone(f, seeds, level)) for f in findings],
                verdict,
                stands_on,
                missing=len(hypothesis.tests) - sum(counts(f, seeds) for f in findings),
                seeds=count,
                level=level,
                decided=0 if verdict is Verdict.inconclusive else count,
                claims=len(family),
            )
        )
    return answers


def counts(finding: Finding, seeds: int | None) -> bool:
    """Return whether a contrast has the seeds that a look needs."""
    return finding.seeds >= LEAST_SEEDS and (seeds is None or finding.seeds == seeds)


def alone(finding: Finding, seeds: int | None, level: float) -> Verdict:
    """Return what a contrast by itself says: inside a claim nothing is adjusted but what contradicts it."""
    if not counts(finding, seeds):
        return Verdict.inconclusive
    if finding.p <= level:
        return Verdict.supported
    if finding.adjusted <= level:
        return Verdict.contradicted
    same = finding.claimed is Claimed.above and finding.within <= level
    return Verdict.equivalent if same else Verdict.inconclusive
