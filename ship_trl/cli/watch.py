"""`python -m ship_trl watch POLICY... target=CASE`: watch the episodes of any policies in a window.

POLICY is random, keep_course, best_known, pretrained, a safetensors file, a result folder (its best and
its last network), or file.py:function of your own. Result folders and pretrained networks bring their
target with them. Without any word, the pretrained network of case 4 is shown. H in the window lists the
keys.
"""

from __future__ import annotations

import shlex

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_policies, add_seed, add_size, make_parser
from ship_trl.policies.entry import Entry
from ship_trl.run.entries import find_entries

FIRST = ["pretrained", "target=4"]


def main(arguments: list[str] | None = None) -> None:
    """Read the words, open the window, play."""
    parser = make_parser("watch", __doc__)
    add_policies(parser)
    parser.add_argument("--compare", action="store_true", help="the first policy beside the second")
    add_seed(parser)
    add_size(parser, "1600x900", "of the window")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        entries = find_entries(options.words or FIRST, options.colour)
        flags = [*["--compare"] * options.compare, *["--colour"] * options.colour]
        words = [*(options.words or FIRST), *flags]
        watch(entries, options.compare, options.seed, options.size, shlex.join(words))


def watch(entries: list[Entry], compare: bool, seed: int, size: tuple[int, int], words: str) -> None:
    """Open a window, and play in it until it is closed; `words` are those of the command line.

    Raises:
        ConfigError: a policy is not right, or there is no screen.
    """
    from ship_trl.run.process import configure_process
    from ship_trl.view.window.display import open_window
    from ship_trl.view.window.playlist import Playlist
    from ship_trl.view.window.session import Session

    configure_process()
    # Load the policies first: what is wrong with them is said without a screen, too.
    session = Session(Playlist(entries, compare, seed))
    with open_window(size, f"python -m ship_trl record {words} --output film.gif makes a film"):
        session.run()
