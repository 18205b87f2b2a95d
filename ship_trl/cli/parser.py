"""Arguments that verbs share; a wrong argument gives one line and exit code 1."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from ship_trl.cli.errors import refusals
from ship_trl.config.bounds import Seed
from ship_trl.config.errors import print_error, require
from ship_trl.config.schema import read_as
from ship_trl.policies.registry import POLICIES

# Pixels of a window or a video; text in a smaller one could not be read.
MIN_WIDTH, MIN_HEIGHT, MAX_SIDE = 640, 360, 9999


class Parser(argparse.ArgumentParser):
    """Prints errors in one line."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # Before Python 3.14 argparse takes -1e3 for an option.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        """Print what is wrong with the arguments, and exit."""
        print_error(f"{message}; see {self.prog} --help")
        sys.exit(1)

    # A value that is not allowed. From Python 3.12.8 on the second no longer calls the first.
    parse_known_args = refusals()(argparse.ArgumentParser.parse_known_args)
    parse_known_intermixed_args = refusals()(argparse.ArgumentParser.parse_known_intermixed_args)


def make_parser(verb: str, description: str | None) -> Parser:
    """Make the parser of a verb."""
    # argparse would join the lines of examples.
    has_examples = "\n    " in (description or "")
    formatter = argparse.RawDescriptionHelpFormatter if has_examples else argparse.HelpFormatter
    return Parser(prog=f"python -m ship_trl {verb}", description=description, formatter_class=formatter)


def add_policies(parser: Parser, default: Sequence[str] | None, seed: str) -> None:
    """Add the words that name policies and cases, as `find_entries` reads them, `--colour` and `--seed`.

    Without a `default` there must be a word; `seed` says what the seed is of.
    """
    told = "; ".join(f"{name}: {one.about}" for name, one in POLICIES.items())
    number, metavar = "+" if default is None else "*", "POLICY | target=CASE"
    parser.add_argument("words", nargs=number, default=default, metavar=metavar, help=told)
    add_number(parser, "--seed", Seed, 0, seed)
    parser.add_argument("--colour", action="store_true", help="networks from files see colours")


def add_number(parser: Parser, option: str, hint: Any, default: float | None, use: str) -> None:
    """Add an option whose value is a number within the bounds of its type."""
    read = partial(read_as, hint, key=option)
    parser.add_argument(option, type=read, default=default, metavar="N", help=use)


def add_target(parser: Parser, default: str) -> None:
    """Add the words `target=CASE` and `situations.KEY=VALUE`, see `ship_trl.run.entries`."""
    told = f"default: target={default}; of encounters of other tools, keys as situations.safe=0.5"
    parser.add_argument("words", nargs="*", metavar="target=CASE|SUITE", help=told)


def add_size(parser: Parser, default: str | None, use: str) -> None:
    """Add `--size`, in pixels."""

    def read(text: str) -> tuple[int, int]:
        is_size = re.fullmatch(r"\d{3,4}x\d{3,4}", text, re.ASCII)
        width, height = map(int, text.split("x")) if is_size else (0, 0)
        allowed = f"WIDTHxHEIGHT, at least {MIN_WIDTH}x{MIN_HEIGHT}, at most {MAX_SIDE}x{MAX_SIDE}"
        require(width >= MIN_WIDTH and height >= MIN_HEIGHT, "--size", allowed, text)
        return width, height

    parser.add_argument("--size", type=read, default=default, metavar="WxH", help=f"in pixels, {use}")


def add_output(parser: Parser, name: str, suffixes: Sequence[str], use: str) -> None:
    """Add the option or argument that names an output file with one of the suffixes; "" means a folder."""
    metavar = "FILE|FOLDER" if "" in suffixes else f"FILE{suffixes[0]}"
    allowed = f"a name that ends with {' or '.join(filter(None, suffixes))}"
    allowed += ", or a new or empty folder" if "" in suffixes else ""

    def read(text: str) -> Path:
        path = Path(text)
        is_free = bool(path.suffix) or not path.exists() or (path.is_dir() and not any(path.iterdir()))
        require(path.suffix in suffixes and is_free, name, allowed, text)
        known = next(folder for folder in path.absolute().parents if folder.exists())
        require(known.is_dir(), name, "in a folder; a new one is made", text)
        return path

    parser.add_argument(name, type=read, metavar=metavar, help=use)
