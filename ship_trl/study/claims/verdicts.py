"""Verdicts on the paper's claims, by the rules of docs/analysis-plan.md.

A claim is supported at the largest p-value of its contrasts (intersection-union test), adjusted by Holm's
method over the claims of its figure. It is contradicted by one contrast in the opposite direction, adjusted
over all contrasts of the figure. A study is judged after every five seeds, at O'Brien and Fleming's levels; a
decision at a look is final.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ship_trl.study.claims.hypotheses import CONCLUSIONS, HYPOTHESES, OURS
from ship_trl.study.claims.kinds import Hypothesis
from ship_trl.study.compare import MIN_SEEDS, Claimed, Finding, Verdict
from ship_trl.study.statistics import LEVEL, holm, look_level, seeds_needed
from ship_trl.study.study import Study

ALL = [*CONCLUSIONS, *HYPOTHESES]
# The seeds that an open claim is said to need may fail to decide it this often.
MAX_FAILURE = 0.2


@dataclass(frozen=True)
class Answer:
    """A claim, measured at the look that decided it, or at the last whole look.

    `p` is the adjusted p-value behind the verdict; for an open claim that of support. `seeds` and `level` are
    those of the look; `missing` contrasts lack seeds there. `decided` is the number of seeds at the verdict,
    0 for an open claim. `claims` is the number of claims of the figure.
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
        """The verdict, or "no runs"."""
        return self.verdict.value if self.findings else "no runs"

    def seeds_wanted(self) -> int | None:
        """Return how many seeds of a study with one look would decide an open claim four times in five.

        This holds if each contrast is as large as its margin, or zero; differences in between may need any
        number. The estimates are not used, because they are what left the claim open. Return None if the
        claim is decided, a contrast has no margin or standard error, or a thousand seeds are too few.
        """
        if self.decided or not self.findings or len(self.findings) < len(self.hypothesis.tests):
            return None
        # All contrasts together, each from both sides, may fail as often as one.
        power = 1 - MAX_FAILURE / (2 * len(self.findings))
        level = LEVEL / 2 / self.claims
        needed = [seeds_needed(f.margin or 0.0, f.error, f.seeds, level, power) for f in self.findings]
        known = [count for count in needed if count is not None]
        return max(known) if len(known) == len(needed) else None


def answer(study: Study, hypotheses: Sequence[Hypothesis] = ALL) -> list[Answer]:
    """Judge claims at each whole look; the claims of a figure are judged together.

    An open claim has the numbers of the last whole look, or of all seeds before the first look.
    """
    figures = dict.fromkeys(h.figure for h in hypotheses)
    families = [[h for h in hypotheses if h.figure == figure] for figure in figures]
    decided: dict[str, Answer] = {}
    answers: list[Answer] = []
    for number, count in enumerate(study.whole_looks, 1):
        level = look_level(number, len(study.looks))
        seen = study.first(count, level)
        answers = [found for family in families for found in judge(seen, family, count, level)]
        for found in answers:
            if found.decided:
                decided.setdefault(found.hypothesis.name, found)
    return [decided.get(found.hypothesis.name, found) for found in answers]


def explore(study: Study) -> list[Answer]:
    """Judge each of our own claims alone, on the seeds of the last whole look."""
    seen = study.first(study.whole_looks[-1], LEVEL / 2)
    return [judge(seen, [hypothesis], None, LEVEL / 2)[0] for hypothesis in OURS]


def judge(study: Study, family: Sequence[Hypothesis], seeds: int | None, level: float) -> list[Answer]:
    """Judge the claims of a figure together.

    A contrast counts if it has `seeds` seeds, or at least five if that is None. The level is one-sided.
    """
    measured = [[finding for test in hypothesis.tests for finding in test(study)] for hypothesis in family]
    # Holm's method counts the planned contrasts, also those that lack runs.
    planned = sum(len(hypothesis.tests) for hypothesis in family)
    against = [f.against if counts(f, seeds) else 1.0 for findings in measured for f in findings]
    adjusted = iter(holm(against + [1.0] * (planned - len(against))))
    measured = [[replace(f, adjusted=next(adjusted)) for f in findings] for findings in measured]
    support, equality = [], []
    for hypothesis, findings in zip(family, measured, strict=True):
        is_whole = len(findings) == len(hypothesis.tests) and all(counts(f, seeds) for f in findings)
        support.append(max(f.p for f in findings) if is_whole else 1.0)
        are_differences = is_whole and all(f.claimed is Claimed.above for f in findings)
        equality.append(max(f.within for f in findings) if are_differences else 1.0)
    answers = []
    for hypothesis, findings, p, within in zip(family, measured, holm(support), holm(equality), strict=True):
        opposite = min((f.adjusted for f in findings), default=1.0)
        verdict = decide(p, opposite, within, level)
        count = seeds or max((f.seeds for f in findings), default=0)
        answers.append(
            Answer(
                hypothesis,
                [replace(f, verdict=judge_alone(f, seeds, level)) for f in findings],
                verdict,
                {Verdict.contradicted: opposite, Verdict.equivalent: within}.get(verdict, p),
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
    return finding.seeds >= MIN_SEEDS and (seeds is None or finding.seeds == seeds)


def decide(support: float, opposite: float, within: float, level: float) -> Verdict:
    """Return the verdict that three p-values give at a level."""
    if support <= level:
        return Verdict.supported
    if opposite <= level:
        return Verdict.contradicted
    return Verdict.equivalent if within <= level else Verdict.inconclusive


def judge_alone(finding: Finding, seeds: int | None, level: float) -> Verdict:
    """Return the verdict on a contrast alone: only its opposite is adjusted."""
    if not counts(finding, seeds):
        return Verdict.inconclusive
    within = finding.within if finding.claimed is Claimed.above else 1.0
    return decide(finding.p, finding.adjusted, within, level)
