"""`python -m ship_trl explain POLICY... target=CASE`: what networks have learned to see, on one page.

POLICY is a result folder (its best network; it brings its target, its source and its own beginning with it)
or a safetensors file. The first is explained; the others, as other seeds, stand beside it.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.errors import ConfigError
from ship_trl.policies.entry import Entry
from ship_trl.run.entries import best_of_folders, find_entries

OUTPUT = Path("outputs/explain")
LEAST_EPISODES = 60
MOST_EPISODES = 600


def main(arguments: list[str] | None = None) -> None:
    """Read the command line, and write page, figures and tables."""
    parser = make_parser("explain", __doc__)
    parser.add_argument("words", nargs="+", metavar="POLICY | target=CASE")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help=f"default: {OUTPUT}",
    )
    parser.add_argument("--seed", type=int, default=0, help="of states, untrained networks and resamples")
    parser.add_argument(
        "--episodes", type=int, default=120, metavar="N", help="ten states are taken of each (default 120)"
    )
    parser.add_argument("--colour", action="store_true", help="networks from files see colours")
    options = parser.parse_args(arguments)
    with refusals():
        if not LEAST_EPISODES <= options.episodes <= MOST_EPISODES:
            raise ConfigError(
                f"--episodes: must be from {LEAST_EPISODES} to {MOST_EPISODES}, got {options.episodes}"
            )
        if not 0 <= options.seed < 2**63:
            raise ConfigError(f"--seed: must be from 0 to 2^63 - 1, got {options.seed}")
        if options.output is None and OUTPUT.is_symlink():
            # A stranger's folder of results may be called outputs.
            raise ConfigError(f"--output: {OUTPUT} is a link; allowed: the folder that it leads to, named")
        entries = choose_entries(options.words, options.colour)
        from ship_trl.explain.write import write

        given = sys.argv[1:] if arguments is None else arguments
        command = shlex.join(["python", "-m", "ship_trl", "explain", *given])
        write(entries, options.output or OUTPUT, options.episodes, options.seed, command)


def choose_entries(words: list[str], colour: bool) -> list[Entry]:
    """Find the networks that are meant: of a result folder its best one.

    Raises:
        ConfigError: there is none, or they are not of one case, one world and one way of seeing.
    """
    entries = best_of_folders(find_entries(words, colour))
    first = entries[0]
    for other in entries[1:]:
        if other.case.fingerprint != first.case.fingerprint:
            raise ConfigError(
                f"target: {first.label} is of case {first.case.name} and {other.label} of case "
                f"{other.case.name}; allowed: one, given as target=CASE"
            )
        if other.world != first.world or other.colour != first.colour:
            raise ConfigError(f"policy: {first.label} and {other.label} are of different worlds or colours")
    return entries
