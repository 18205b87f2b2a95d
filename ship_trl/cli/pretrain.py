"""`python -m ship_trl pretrain FOLDER`: train the bundled networks, one for each bundled case.

Seeds 100 to 104 learn each case from scratch with profile=quick. The network with the highest greedy return
is kept, on ties the one with the lower seed. It is written in half precision if its greedy episode stays the
same. With `--suites` the networks of random encounters are trained instead: two of numbers, one of
which keeps the rules, and one of pixels, which learns from the first; each with some seeds. The first
seed is kept, and all greedy episodes on the Imazu problems must stay the same. Finished runs are not
repeated. Other networks in FOLDER's manifest stay.
"""

from __future__ import annotations

from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.run.pretrain import RUNS, make_cases, make_suites


def main(arguments: list[str] | None = None) -> None:
    """Run the missing trainings, then choose and write the networks."""
    parser = make_parser("pretrain", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where networks and manifest are written")
    parser.add_argument("--suites", action="store_true", help="the networks of random encounters")
    parser.add_argument("--runs", type=Path, default=RUNS, metavar="FOLDER", help=f"of the runs ({RUNS})")
    options = parser.parse_args(arguments)
    with refusals():
        options.folder.mkdir(parents=True, exist_ok=True)
        if options.suites:
            make_suites(options.folder, options.runs)
        else:
            make_cases(options.folder, options.runs)
