"""`python -m ship_trl ask FOLDER "low: FE3 above FE4 (asymptote)"`: measure any contrast of a study's arms.

    every pair: FTW above scratch (early area)
    low: every arm sooner than scratch (time)
    lowest: mean of FT1, FT2 above mean of FE1, FE2
    low: FE4 above FE4 of 4 to 4
    low: FE4 (start)

An estimate is the interquartile mean over seeds of the difference within a seed, as in the report; for times,
how much sooner. Without a second arm it is the level of the first one. Intervals are at 95 %, unadjusted, and
decide no claim. A study under way shows the seeds of its last look, or the first --seeds.
"""

from __future__ import annotations

import math
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.run.console import show
from ship_trl.study.ask import ask
from ship_trl.study.statistics import LEVEL, Estimate
from ship_trl.study.study import Study, finished_study

HEADINGS = ("contrast", "estimate", "95 %", "seeds", "above zero", "beside")


def main(arguments: list[str] | None = None) -> None:
    """Print a row for each contrast."""
    parser = make_parser("ask", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of a study, or of its kept tables")
    parser.add_argument("questions", nargs="+", metavar="QUESTION", help="WHERE: ARM above ARM (METRIC)")
    parser.add_argument("--seeds", type=int, metavar="N", help="the first N seeds only")
    options = parser.parse_args(arguments)
    with refusals():
        study = finished_study(options.folder, options.seeds)
        show(HEADINGS, map(row, answers(study, options.questions, options.seeds)))


def answers(study: Study, questions: list[str], seeds: int | None = None) -> list[Estimate]:
    """Measure questions on the first `seeds` seeds, or on those of the last look.

    Contrasts of `every pair` and `every arm` with too few seeds are left out, and counted on stderr.
    """
    shown = study.first(study.whole_looks[-1] if seeds is None else seeds, LEVEL / 2)
    found = []
    for question in questions:
        contrasts = ask(shown, question)
        # A metric that a run has not measured is NaN.
        every = [contrast.measure(shown) for contrast in contrasts]
        measured = [one for one in every if one is not None and math.isfinite(one.value)]
        if not measured:
            raise ConfigError(f"question: {question!r} needs its metric of two seeds that all its arms have")
        if few := len(contrasts) - len(measured):
            print_error(f"{question}: {few} of {len(contrasts)} lack it for two common seeds; left out")
        found += measured
    return found


def row(found: Estimate) -> list[str]:
    """Format a contrast, with the number of seeds above zero."""
    above = f"{sum(value > 0 for value in found.differences)} of {found.seeds}"
    beside = ", ".join(f"{name} {one.value:+.3f} ({one.interval()})" for name, one in found.beside.items())
    return [found.what, f"{found.value:+.3f}", found.interval(), str(found.seeds), above, beside]
