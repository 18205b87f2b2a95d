"""`python -m ship_trl explain POLICY... target=CASE`: what networks have learned to see, on one page.

POLICY is a result folder (its best network, with its target, its source and itself before training) or a
safetensors file. The first is explained and compared with the others, for example other seeds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from pydantic import Field

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_policies, make_parser
from ship_trl.config.errors import ConfigError, command
from ship_trl.policies.registry import Entry
from ship_trl.run.entries import drop_last_networks, find_entries

OUTPUT = Path("outputs/explain")
Episodes = Annotated[int, Field(ge=60, le=600)]


def main(arguments: list[str] | None = None) -> None:
    """Read the command line, and write page, figures and tables."""
    parser = make_parser("explain", __doc__)
    add_policies(parser, None, "of states, untrained networks and resamples")
    parser.add_argument("--output", type=Path, metavar="FOLDER", help=f"default: {OUTPUT}")
    add_number(parser, "--episodes", Episodes, 120, "each gives ten states (default 120)")
    options = parser.parse_args(arguments)
    with refusals():
        if options.output is None and OUTPUT.is_symlink():
            # An untrusted folder of results may be called outputs.
            raise ConfigError(f"--output: {OUTPUT} is a link; allowed: --output=FOLDER")
        entries = choose_entries(options.words, options.colour)
        from ship_trl.explain.page import write

        given = sys.argv[1:] if arguments is None else arguments
        write(entries, options.output or OUTPUT, options.episodes, options.seed, command("explain", *given))


def choose_entries(words: list[str], colour: bool) -> list[Entry]:
    """Find the networks that the words name; of a result folder its best one.

    Raises:
        ConfigError: there is no network, or they differ in case, world or colours.
    """
    entries = drop_last_networks(find_entries(words, colour))
    seen = [(one.suite.case.fingerprint, one.world, one.colour) for one in entries]
    for other, here in zip(entries, seen, strict=True):
        if here != seen[0]:
            names = " and ".join(f"{one.label} (case {one.suite.case.name})" for one in (entries[0], other))
            raise ConfigError(f"policy: {names} differ in case, world or colours; allowed: one target=CASE")
    return entries
