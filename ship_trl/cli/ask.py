"""`python -m ship_trl ask FOLDER "low: FE3 above FE4 (asymptote)"`: any contrast of a study's arms.

    every pair: FTW above scratch (early area)
    low: every arm sooner than scratch (time)
    lowest: mean of FT1, FT2 above mean of FE1, FE2
    low: FE4 above FE4 of 4 to 4
    low: FE4 (start)

Estimates are interquartile means over seeds of the difference within a seed, as in the report; of times, how
much sooner. Without a second arm it is the first one's level. Each interval stands for itself, at 95 %: what
is asked after the runs were seen explores, and decides no claim. Of a study under way the seeds of its last
look are shown, or the first --seeds.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.study.analysis.contrasts import Finding
from ship_trl.study.analysis.statistics import LEVEL, Estimate
from ship_trl.study.analysis.study import Study, finished_study
from ship_trl.study.claims.questions import ask
from ship_trl.study.claims.verdicts import reached

# Columns of a table that goes into a file or a pipe.
WIDEST = 1_000
HEADINGS = ("contrast", "estimate", "95 %", "seeds", "above zero", "beside")


def main(arguments: list[str] | None = None) -> None:
    """Print a row for each contrast."""
    parser = make_parser("ask", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a study, or its kept tables")
    parser.add_argument("questions", nargs="+", metavar="QUESTION", help="WHERE: ARM above ARM (METRIC)")
    parser.add_argument("--seeds", type=int, metavar="N", help="the first N seeds alone")
    options = parser.parse_args(arguments)
    with refusals():
        study = finished_study(options.folder, options.seeds)
        table = Table(*HEADINGS)
        for finding in answers(study, options.questions, options.seeds):
            table.add_row(*row(finding))
        # In a pipe no line is broken.
        Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else WIDEST).print(table)


def answers(study: Study, questions: list[str], seeds: int | None = None) -> list[Finding]:
    """Measure what is asked for, on the first `seeds` seeds, or on those of the last look.

    Of `every pair` and `every arm` what has too few seeds is left out, and counted on stderr.

    Raises:
        ConfigError: a question cannot be read, or two seeds that all its arms have are not there.
    """
    shown = study.first(reached(study)[-1] if seeds is None else seeds, LEVEL / 2)
    found = []
    for question in questions:
        tests = ask(shown, question)
        measured = [finding for test in tests for finding in test(shown, "")]
        if not measured:
            raise ConfigError(f"question: {question!r} needs two seeds that all of its arms have")
        if few := len(tests) - len(measured):
            print_error(f"{question}: {few} of {len(tests)} have less than two seeds in common; left out")
        found += measured
    return found


def row(finding: Finding) -> list[str]:
    """Write a contrast: signs everywhere, and how many of the seeds have it above zero."""
    beside = ", ".join(f"{name} {interval(one)}" for name, one in finding.beside.items())
    above = f"{sum(value > 0 for value in finding.differences)} of {finding.seeds}"
    low, high = (f"{end:+.3f}" for end in (finding.estimate.low, finding.estimate.high))
    return [
        finding.what,
        f"{finding.estimate.value:+.3f}",
        f"{low} to {high}",
        str(finding.seeds),
        above,
        beside,
    ]


def interval(one: Estimate) -> str:
    """Write an estimate with its interval."""
    return f"{one.value:+.3f} ({one.low:+.3f} to {one.high:+.3f})"
