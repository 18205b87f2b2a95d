"""`python -m studies.law`: which sources are worth training, from the kept tables of the study of sources?

plan.md has the rules. It takes most of a minute.

Writes:
    studies/law/README.md         the tables between its marks
    studies/law/tables.md         more tables
    outputs/law/                  predicted and measured gains, regrets, a picture
    ship_trl/transfer/law.json    coefficients that `ship_trl cases` recommends by
"""

from __future__ import annotations

import os

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser


def main(arguments: list[str] | None = None) -> None:
    """Fit, choose, and write."""
    parser = make_parser("", __doc__)
    parser.prog = "python -m studies.law"
    parser.parse_args(arguments)
    os.environ["MPLBACKEND"] = "agg"
    with refusals():
        from studies.law.report import report

        report()


if __name__ == "__main__":
    main()
