"""`python -m ship_trl watch POLICY... target=CASE|SUITE`: watch episodes of any policies in a window.

POLICY is a name below, pretrained, a safetensors or ONNX file, a result folder (its best and its last
network), file.py:function of your own, or trusted:FILE.zip of Stable-Baselines3. Result folders and
pretrained networks have their own target. Of several cases, those in which the first policy misses the goal
come first; C shows the next. Without a policy, the pretrained network of case 4 is shown. Press H in the
window for the keys.
"""

from __future__ import annotations

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_policies, add_size, make_parser
from ship_trl.config.errors import command
from ship_trl.policies.registry import split_suites
from ship_trl.run.entries import find_entries

DEFAULT_WORDS = ["pretrained", "target=4"]


def main(arguments: list[str] | None = None) -> None:
    """Read the arguments, open the window, play."""
    parser = make_parser("watch", __doc__)
    add_policies(parser, DEFAULT_WORDS, "of the first random encounter, and of policies that draw")
    parser.add_argument("--compare", action="store_true", help="the first policy beside the second")
    add_size(parser, None, "of the window; default: as large as the screen allows")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        entries = split_suites(find_entries(options.words, options.colour), options.seed)

        from ship_trl.policies.named import failures_first
        from ship_trl.run.process import configure_process
        from ship_trl.view.window import Session, open_window

        configure_process()
        # Load the policies first: their errors are shown without a screen, too.
        session = Session(failures_first(entries, options.seed), options.compare, options.seed)
        flags = [*["--compare"] * options.compare, *["--colour"] * options.colour]
        record = command("record", *options.words, *flags, "--output", "film.gif")
        with open_window(options.size, f"{record} makes a film"):
            session.run()
