"""How often the rules see what is not there: the study's own runs with their arms' labels shuffled."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ship_trl.study.answers import ALL, Answer, answer
from ship_trl.study.contrasts import Claimed, Finding, Verdict
from ship_trl.study.measured import SEED, Study

SHUFFLES = 20
# The verdict hangs on p-values, which need no resampling; the intervals may be rough.
RESAMPLES = 400


@dataclass(frozen=True)
class Placebo:
    """What was found where there is nothing: contrasts, and figures with any, and of how many."""

    contrasts: int
    of_contrasts: int
    figures: int
    of_figures: int


def shuffled(study: Study, rng: np.random.Generator) -> Study:
    """The study with its arms' labels shuffled within each target case and seed."""
    groups = defaultdict(list)
    for key, record in sorted(study.records.items()):
        groups[record.target, record.seed].append(key)
    records = {}
    for keys in groups.values():
        for key, other in zip(keys, rng.permutation(len(keys)), strict=True):
            records[key] = study.records[keys[other]]
    return Study(records, resamples=RESAMPLES, rough=True)


def is_false(finding: Finding) -> bool:
    """Whether a finding is wrong where labels mean nothing: it says that arms differ."""
    above = finding.claimed is Claimed.above
    wrong = {Verdict.contradicted, Verdict.supported} if above else {Verdict.contradicted}
    return finding.between and finding.verdict in wrong


def placebo(study: Study, shuffles: int = SHUFFLES) -> Placebo:
    """Measure all claims on shuffled labels, again and again."""
    rng = np.random.default_rng(SEED)
    tries = [answer(shuffled(study, rng), ALL) for _ in range(shuffles)]
    findings = [f for answers in tries for a in answers for f in a.findings if f.between]
    families = [family for answers in tries for family in by_figure(answers)]
    return Placebo(
        sum(map(is_false, findings)),
        len(findings),
        sum(any(map(is_false, family)) for family in families),
        len(families),
    )


def by_figure(answers: Sequence[Answer]) -> list[list[Finding]]:
    """The findings of each figure that has any."""
    found: dict[str, list[Finding]] = defaultdict(list)
    for one in answers:
        found[one.hypothesis.figure] += one.findings
    return [family for family in found.values() if family]
