"""`python -m ship_trl keep FOLDER COPY`: copy what a study's report needs, small enough to commit.

`python -m ship_trl keep --restore COPY FOLDER` makes a study's folder from its copy. The study goes on
from there, and does not train complete seeds again.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser


def main(arguments: list[str] | None = None) -> None:
    """Copy a study and print the size of the copy, or restore it and print the seeds left to train."""
    parser = make_parser("keep", __doc__)
    parser.add_argument("--restore", action="store_true", help="make a study's folder from a copy")
    parser.add_argument("origin", type=Path, metavar="FOLDER", help="of a study, as outputs/quick_study")
    parser.add_argument("goal", type=Path, metavar="COPY", help="of the tables; --restore swaps the two")
    options = parser.parse_args(arguments)
    origin, goal = options.origin, options.goal
    with refusals():
        from ship_trl.study.tables import CURVES, RUNS, restore, write_tables

        if options.restore:
            runs, others = restore(origin, goal)
            seeds = " ".join(map(str, others))
            left = f"; not complete, to be trained again: seeds {seeds}" if others else ""
            sys.stdout.write(f"{runs} runs{left}; {goal}\n")
            return
        whole, broken = write_tables(origin, goal)
        size = sum((goal / name).stat().st_size for name in (RUNS, CURVES))
        left = f", {broken} left out" if broken else ""
        sys.stdout.write(f"{whole} runs{left}; {size / whole / 1000:.1f} kB a run in {goal}\n")
