"""`python -m ship_trl play target=CASE|SUITE`: steer a ship yourself, with the keyboard.

The window compares your return with the best known one. A finished episode is kept as a demonstration, with
which a training can begin (demonstrations=FOLDER). The default is case 4; of several cases, separated by
commas or of a suite, C goes to the next. Press H in the window for the keys.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_size, add_target, make_parser
from ship_trl.policies.registry import Entry, split_suites
from ship_trl.run.entries import find_suites

DEFAULT = "4"


def main(arguments: list[str] | None = None) -> None:
    """Read the arguments, open the window, play."""
    parser = make_parser("play", __doc__)
    add_target(parser, DEFAULT)
    folder = Path("outputs/demonstrations")
    keep = f"where episodes are kept; default: {folder}"
    parser.add_argument("--demonstrations", type=Path, default=folder, metavar="FOLDER", help=keep)
    parser.add_argument("--keep-nothing", action="store_true", help="keep no demonstrations")
    add_size(parser, None, "of the window; default: as large as the screen allows")
    options = parser.parse_args(arguments)
    with refusals():
        _, suites, world = find_suites(options.words, DEFAULT)
        entries = split_suites(Entry("play", "play", suite, world, False) for suite in suites)
        cases = [case for entry in entries for case in entry.suite.cases]

        from ship_trl.run.process import configure_process
        from ship_trl.view.window import Game, open_window

        configure_process()
        game = Game(cases, world, None if options.keep_nothing else options.demonstrations)
        command = "python -m ship_trl evaluate POLICY target=CASE --demonstrations FOLDER"
        with open_window(options.size, f"{command} keeps a policy's episodes"):
            game.run()
        for path in game.kept:
            sys.stdout.write(f"{path}\n")
