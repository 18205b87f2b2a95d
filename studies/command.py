"""The command line of a study whose runs learn in lockstep: `run` makes the runs, `report` judges them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ship_trl.cli.parser import Parser, add_number, make_parser
from ship_trl.config.bounds import Positive


def make_parsers(name: str, doc: str | None, folder: Path, settings: Iterable[str]) -> tuple[Parser, Parser]:
    """Make the parser of `python -m studies.NAME run|report`, and that of `report` in it."""
    os.environ["MPLBACKEND"] = "agg"
    parser = make_parser("", f"{doc}\nWrites:\n    {folder}/SETTING*.csv, SETTING.png and weights")
    parser.prog = f"python -m studies.{name}"
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="run|report")
    run, report = verbs.add_parser("run"), verbs.add_parser("report")
    run.add_argument("setting", choices=settings, help="what networks see")
    add_number(run, "--processes", Positive, 2, "at once (default 2)")
    run.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default cpu")
    report.add_argument("--markdown", action="store_true", help="print Markdown tables")
    return parser, report
