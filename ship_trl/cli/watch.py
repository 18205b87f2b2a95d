"""`python -m ship_trl watch POLICY... target=CASE`: watch any policies sail, in a window.

POLICY is random, keep_course, best_known, pretrained, a safetensors file, a result folder (its best and
its last network), or file.py:function of your own. Result folders and pretrained networks bring their
target with them. Without any word, the pretrained network of case 4 is shown. H in the window lists the
keys.
"""

from __future__ import annotations

import re
import shlex

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError
from ship_trl.policies.entry import Entry
from ship_trl.run.entries import find_entries

FIRST = ["pretrained", "target=4"]


def main(arguments: list[str] | None = None) -> None:
    """Read the words, open the window, play."""
    parser = make_parser("watch", __doc__)
    parser.add_argument("words", nargs="*", metavar="POLICY | target=CASE")
    parser.add_argument("--compare", action="store_true", help="the first policy beside the second")
    parser.add_argument("--seed", type=int, default=0, help="of policies that draw")
    parser.add_argument("--colour", action="store_true", help="networks see colours")
    parser.add_argument("--size", default="1600x900", metavar="WxH", help="of the window, in pixels")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        size = read_size(options.size)
        check_seed(options.seed)
        entries = find_entries(options.words or FIRST, options.colour)
        flags = [*["--compare"] * options.compare, *["--colour"] * options.colour]
        words = [*(options.words or FIRST), *flags]
        watch(entries, options.compare, options.seed, size, shlex.join(words))


def read_size(text: str) -> tuple[int, int]:
    """Read a size such as 1600x900.

    Raises:
        ConfigError: it is none, or one in which nothing could be read.
    """
    found = re.fullmatch(r"(\d{3,4})x(\d{3,4})", text)
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    if size[0] < 640 or size[1] < 360:
        raise ConfigError(f"--size: must be WIDTHxHEIGHT, at least 640x360, at most 9999x9999, got {text}")
    return size


def check_seed(seed: int) -> None:
    """Refuse a seed that generators do not take.

    Raises:
        ConfigError: it is out of range.
    """
    if not 0 <= seed < 2**62:
        raise ConfigError(f"--seed: must be from 0 to 2^62 - 1, got {seed}")


def watch(entries: list[Entry], compare: bool, seed: int, size: tuple[int, int], words: str) -> None:
    """Open a window, and play in it until it is closed; `words` are those of the command line.

    Raises:
        ConfigError: a policy is not right, or there is no screen.
    """
    from ship_trl.run.process import configure_process
    from ship_trl.view.window.display import NoScreenError, open_window
    from ship_trl.view.window.playlist import Playlist
    from ship_trl.view.window.session import Session

    configure_process()
    # First what is wrong with the policies: without a screen, too, this is what has to be mended.
    session = Session(Playlist(entries, compare, seed))
    try:
        with open_window(size, "ship_trl"):
            session.run()
    except NoScreenError as error:
        raise ConfigError(
            f"no screen ({error}); python -m ship_trl record {words} --output film.gif makes a film"
        ) from None
