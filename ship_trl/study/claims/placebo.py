"""How often the rules see what is not there: the study's own runs with their arms' labels shuffled."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from ship_trl.study.analysis.contrasts import Claimed, Verdict
from ship_trl.study.analysis.measured import SEED, SPREAD
from ship_trl.study.analysis.study import Study
from ship_trl.study.claims.verdicts import answer

SHUFFLES = 20
# Claims of spreads are judged as they are but not counted: with as many permutations as would decide one,
# twenty shuffles take longer than all else of a report.
RESAMPLES = 2


@dataclass(frozen=True)
class Placebo:
    """What was found where there is nothing: claims of levels, figures with any, and of how many."""

    claims: int
    of_claims: int
    figures: int
    of_figures: int


def shuffled(study: Study, rng: np.random.Generator) -> Study:
    """Return the study with its arms' labels shuffled within each target case and seed."""
    groups = defaultdict(list)
    for key, record in sorted(study.records.items()):
        groups[record.target, record.seed].append(key)
    records = {}
    for keys in groups.values():
        for key, other in zip(keys, rng.permutation(len(keys)), strict=True):
            records[key] = study.records[keys[other]]
    return replace(study, records=records, resamples=RESAMPLES)


def placebo(study: Study, shuffles: int = SHUFFLES) -> Placebo:
    """Judge all claims of differences between levels on shuffled labels, again and again."""
    rng = np.random.default_rng(SEED)
    false: dict[tuple[int, str], list[bool]] = defaultdict(list)
    for number in range(shuffles):
        for found in answer(shuffled(study, rng)):
            if found.findings and all(
                f.claimed is Claimed.above and f.metric != SPREAD for f in found.findings
            ):
                wrong = found.verdict in (Verdict.supported, Verdict.contradicted)
                false[number, found.hypothesis.figure].append(wrong)
    return Placebo(
        claims=sum(map(sum, false.values())),
        of_claims=sum(map(len, false.values())),
        figures=sum(map(any, false.values())),
        of_figures=len(false),
    )
