"""All claims measured on a study. What a figure tests is one family, within which p-values are adjusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ship_trl.study.claims import Hypothesis
from ship_trl.study.conclusions import CONCLUSIONS
from ship_trl.study.contrasts import Finding, Verdict, adjust, together
from ship_trl.study.hypotheses import HYPOTHESES
from ship_trl.study.measured import Study

ALL = [*CONCLUSIONS, *HYPOTHESES]


@dataclass(frozen=True)
class Answer:
    """A claim measured; `missing` is how many of its contrasts have no runs."""

    hypothesis: Hypothesis
    findings: list[Finding]
    verdict: Verdict
    missing: int


def answer(study: Study, hypotheses: Sequence[Hypothesis] = ALL) -> list[Answer]:
    """Measure all claims; within a figure p-values are adjusted together."""
    answers = []
    for figure in dict.fromkeys(h.figure for h in hypotheses):
        family = [h for h in hypotheses if h.figure == figure]
        measured = {h.name: [f for test in h.tests for f in test(study, h.name)] for h in family}
        adjusted = iter(adjust([finding for found in measured.values() for finding in found]))
        for hypothesis in family:
            findings = [next(adjusted) for _ in measured[hypothesis.name]]
            missing = len(hypothesis.tests) - len(findings)
            verdict = together([finding.verdict for finding in findings], missing)
            answers.append(Answer(hypothesis, findings, verdict, missing))
    return answers
