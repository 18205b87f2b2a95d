"""`python -m ship_trl.study.sensitivity FOLDER`: would other tests than the plan's have said the same?

Beside the plan's verdict on each claim stands what it would be by means, whose tails count, with t-tests in
the place of Yuen's; and by all changes of place of two arms' curves, where the plan's test of spread draws
some, with the p that this changes. Then how many seeds have the same difference to the last digit, in the
contrast where most do: such a tie shows nothing of chance. Looks, Holm's method and margins are the plan's.
It decides nothing.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy import stats

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.study.analysis.contrasts import Claimed, Finding
from ship_trl.study.analysis.measured import SPREAD
from ship_trl.study.analysis.statistics import SAME
from ship_trl.study.analysis.study import Study, finished_study
from ship_trl.study.claims.kinds import Hypothesis
from ship_trl.study.claims.verdicts import ALL, Answer, answer

# Ways of two arms to change places: of 16 seeds, in some minutes. Beyond them there is no such column.
MOST_SWAPS = 2**16
PLAN, MEANS, SWAPPED = "the plan", "means", "all changes of place"
# Columns of a table that goes into a file or a pipe.
WIDEST = 1_000
HEADINGS = ("claim", PLAN, MEANS, SWAPPED, "p of spreads that changes", "seeds that tie")


def main(arguments: list[str] | None = None) -> None:
    """Print a row for each claim, and how many verdicts would be others."""
    parser = make_parser("sensitivity", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a study, or its kept tables")
    options = parser.parse_args(arguments)
    with refusals():
        study = finished_study(options.folder)
        found = answers(study)
        table = Table(*HEADINGS)
        for row in rows(found):
            table.add_row(*row)
        # In a pipe no line is broken.
        Console(highlight=False, width=None if sys.stdout.isatty() else WIDEST).print(table)
        for way in found:
            if way != PLAN:
                sys.stdout.write(
                    f"By {way} {others(found, way)} of {len(found[PLAN])} verdicts are others.\n"
                )


def others(found: Mapping[str, Sequence[Answer]], way: str) -> int:
    """Count the verdicts that another way than the plan's would change."""
    return sum(one.verdict is not two.verdict for one, two in zip(found[PLAN], found[way], strict=True))


def answers(study: Study, hypotheses: Sequence[Hypothesis] = ALL) -> dict[str, list[Answer]]:
    """Judge the claims in each way; all changes of place only where they can be counted."""
    found = {PLAN: answer(study, hypotheses), MEANS: answer(study, hypotheses, by_means)}
    if 2 ** len(study.seeds) <= MOST_SWAPS:
        found[SWAPPED] = answer(replace(study, resamples=MOST_SWAPS), hypotheses)
    return found


def by_means(finding: Finding) -> Finding:
    """Test a contrast of levels by its mean over seeds, with t-tests; others are as they were."""
    values = np.array(finding.differences)
    if len(values) < 2 or np.std(values) < SAME:
        return finding

    def p(bound: float, alternative: str) -> float:
        return float(stats.ttest_1samp(values, bound, alternative=alternative).pvalue)

    above, below, margin = p(0.0, "greater"), p(0.0, "less"), finding.margin
    if margin is None:
        known = finding.claimed is Claimed.above
        return replace(finding, p=above if known else 1.0, against=below if known else 1.0)
    within = max(p(margin, "less"), p(-margin, "greater"))
    if finding.claimed is Claimed.no_more:
        above, below = p(margin, "less"), p(margin, "greater")
    return replace(finding, p=above, against=below, within=within)


def rows(found: Mapping[str, Sequence[Answer]]) -> list[list[str]]:
    """Make a row for each claim."""
    made = []
    for number, one in enumerate(found[PLAN]):
        others = [found[way][number] if way in found else None for way in (MEANS, SWAPPED)]
        verdicts = ["-" if other is None else other.word for other in others]
        made.append([one.hypothesis.name, one.word, *verdicts, spreads(one, others[-1]), ties(one)])
    return made


def spreads(drawn: Answer, every: Answer | None) -> str:
    """Write the p of a claim's contrasts of spread, drawn -> by all ways, where these differ.

    Of both sides the smaller one, for a contradiction stands on the other; of one look alone.
    """
    known = {f.what: f for f in every.findings} if every and every.seeds == drawn.seeds else {}
    pairs = [(f, known[f.what]) for f in drawn.findings if f.metric == SPREAD and f.what in known]
    return ", ".join(
        f"{least(one):.2g} -> {least(two):.2g}" for one, two in pairs if least(one) != least(two)
    )


def least(finding: Finding) -> float:
    """Return the p of the side that a contrast leans to."""
    return min(finding.p, finding.against)


def ties(one: Answer) -> str:
    """Say how many seeds have the same difference, in the contrast of levels where most do; "" if none."""
    # Rounded, for sums of the same numbers in another order differ by their last bit.
    counts = [Counter(np.round(f.differences, 10).tolist()) for f in one.findings if f.differences]
    most = max((max(count.values()) for count in counts), default=0)
    return str(most) if most > 1 else ""


if __name__ == "__main__":
    main()
