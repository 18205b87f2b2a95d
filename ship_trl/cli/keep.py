"""`python -m ship_trl keep FOLDER COPY`: what a study's report needs, small enough to commit.

With --restore, `python -m ship_trl keep --restore COPY FOLDER`, a study's folder from its copy: the
study goes on from it, and trains nothing again of the seeds that are complete.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError, print_error


def main(arguments: list[str] | None = None) -> None:
    """Copy a study, or restore it."""
    parser = make_parser("keep", __doc__)
    parser.add_argument("--restore", action="store_true", help="from a copy to a study's folder")
    parser.add_argument("origin", type=Path, metavar="FOLDER", help="a study's, as outputs/quick_study")
    parser.add_argument(
        "goal", type=Path, metavar="COPY", help="where the copy lies; with --restore, the other way"
    )
    options = parser.parse_args(arguments)
    try:
        (restored if options.restore else kept)(options.origin, options.goal)
    except ConfigError as error:
        print_error(str(error))
        sys.exit(1)


def kept(folder: Path, copy: Path) -> None:
    """Copy, and say how much."""
    from ship_trl.study.records.tables import CURVES, RUNS, write_tables

    whole, broken = write_tables(folder, copy)
    size = sum((copy / name).stat().st_size for name in (RUNS, CURVES))
    left = f", {broken} left out" if broken else ""
    sys.stdout.write(f"{whole} runs{left}; {size / whole / 1000:.1f} kB a run in {copy}\n")


def restored(copy: Path, folder: Path) -> None:
    """Restore, and say what is left to train."""
    from ship_trl.study.records.restore import restore
    from ship_trl.study.records.tables import read_tables

    runs, others = restore(read_tables(copy, "copy"), folder)
    left = f"; not complete, to be trained anew: seeds {' '.join(map(str, others))}" if others else ""
    sys.stdout.write(f"{runs} runs{left}; {folder}\n")
