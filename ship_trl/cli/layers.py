"""`python -m ship_trl layers FOLDER TABLE`: measure the similarity of layers in a study's networks (CKA)."""

from __future__ import annotations

from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser


def main(arguments: list[str] | None = None) -> None:
    """Add the seeds that the table lacks."""
    parser = make_parser("layers", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a study's, with its networks")
    parser.add_argument("table", type=Path, metavar="TABLE", help="a CSV to which missing seeds are added")
    options = parser.parse_args(arguments)
    with refusals():
        from ship_trl.explain.study import add_seeds

        add_seeds(options.folder, options.table)
