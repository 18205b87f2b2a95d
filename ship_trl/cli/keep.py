"""`python -m ship_trl keep FOLDER COPY`: copies what a study's report needs, small enough to commit.

`python -m ship_trl keep --restore COPY FOLDER` makes a study's folder from its copy. The study goes on
from there, and does not train complete seeds again.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser


def main(arguments: list[str] | None = None) -> None:
    """Copy a study, or restore it."""
    parser = make_parser("keep", __doc__)
    parser.add_argument("--restore", action="store_true", help="from a copy to a study's folder")
    parser.add_argument("origin", type=Path, metavar="FOLDER", help="of a study, as outputs/quick_study")
    parser.add_argument("goal", type=Path, metavar="COPY", help="of the tables; with --restore in exchange")
    options = parser.parse_args(arguments)
    with refusals():
        (restore_study if options.restore else keep_study)(options.origin, options.goal)


def keep_study(folder: Path, copy: Path) -> None:
    """Copy a study and print the size of the copy."""
    from ship_trl.study.records.tables import CURVES, RUNS, write_tables

    whole, broken = write_tables(folder, copy)
    size = sum((copy / name).stat().st_size for name in (RUNS, CURVES))
    left = f", {broken} left out" if broken else ""
    sys.stdout.write(f"{whole} runs{left}; {size / whole / 1000:.1f} kB a run in {copy}\n")


def restore_study(copy: Path, folder: Path) -> None:
    """Restore a study and print the seeds that are left to train."""
    from ship_trl.study.records.restore import restore
    from ship_trl.study.records.tables import read_tables

    runs, others = restore(read_tables(copy, "copy"), folder)
    left = f"; not complete, to be trained anew: seeds {' '.join(map(str, others))}" if others else ""
    sys.stdout.write(f"{runs} runs{left}; {folder}\n")
