"""`python -m tests.fuzz`: try many inputs of every kind, and print one table of what became of them."""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable
from typing import Any

import torch
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.strategies import nothing
from rich.console import Console
from rich.table import Table

from tests.fuzz.commands import LONG, Command
from tests.fuzz.judge import TooSlowError
from tests.fuzz.kinds import KINDS, Kind, command

# A fixed list: a process each takes a second or more.
COMMANDS = "commands"


class Tally:
    """What became of the inputs of one kind; `faults` holds the smallest input of each sort of fault."""

    def __init__(self) -> None:
        self.ran = self.refused = 0
        self.failed: Counter[str] = Counter()
        self.faults: dict[str, tuple[str, str]] = {}
        self.seconds = self.slowest = 0.0

    def note(self, kind: Kind, given_input: Any) -> None:
        """Try one input."""
        started = time.perf_counter()
        try:
            if kind.attempt(given_input):
                self.ran += 1
            else:
                self.refused += 1
        except (Exception, TooSlowError) as error:
            self.fault(error, repr(given_input))
        took = time.perf_counter() - started
        self.seconds += took
        self.slowest = max(self.slowest, took)

    def fault(self, error: BaseException, shown: str) -> None:
        """Note a fault under its kind and the places of the program that it came by."""
        frames = traceback.extract_tb(error.__traceback__)
        ours = [f for f in frames if "ship_trl" in f.filename and "tests" not in f.filename] or frames
        sort = f"{type(error).__name__} at {ours[-1].filename.rpartition('/')[2]}:{ours[-1].lineno}"
        self.failed[sort] += 1
        told = f"{type(error).__name__}: {str(error)[:300]}"
        if sort not in self.faults or len(shown) < len(self.faults[sort][0]):
            self.faults[sort] = shown, told


def fuzz(kind: Kind, examples: int, number: int) -> Tally:
    """Try so many inputs of a kind."""
    tally = Tally()

    @seed(number)
    @settings(
        max_examples=examples,
        database=None,
        deadline=None,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(kind.inputs)
    def attempt(given_input: Any) -> None:
        tally.note(kind, given_input)

    attempt()
    return tally


def each(given: Iterable[Command]) -> Tally:
    """Give each of the commands once."""
    tally = Tally()
    for one in given:
        tally.note(Kind(nothing(), command), one)
    return tally


def report(kinds: list[str], examples: int, number: int, table: Table, console: Console) -> int:
    """Fuzz kinds, a row of the table each, and show each sort of fault; returns how many there were."""
    wrong = 0
    for name in kinds:
        tally = each(LONG) if name == COMMANDS else fuzz(KINDS[name], max(1, examples), number)
        failed = tally.failed.total()
        tried = tally.ran + tally.refused + failed
        times = f"{tally.seconds / tried * 1000:.0f}", f"{tally.slowest:.1f}"
        # The table comes at the end, which may be minutes from now.
        console.print(f"{name}: {tried} tried, {failed} failed, {tally.seconds:.0f} s")
        table.add_row(name, *map(str, (tried, tally.ran, tally.refused, failed)), *times)
        for sort, (shown, told) in tally.faults.items():
            line = f"{name}: {tally.failed[sort]} x {sort}\n    {told}\n    {shown[:500]}"
            console.print(line, markup=False, soft_wrap=True)
        wrong += failed
    return wrong


def main() -> None:
    """Fuzz every kind; exit code 1 where an input did neither run nor get refused."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--examples", type=int, default=1000, help="of all kinds together (default 1000)")
    parser.add_argument("--seed", type=int, default=0, help="the same inputs for the same seed (default 0)")
    parser.add_argument("--kind", choices=[*KINDS, COMMANDS], help="only this one")
    options = parser.parse_args()
    if options.examples < 1:
        parser.error("--examples: at least 1")
    torch.set_num_threads(1)
    kinds = [options.kind] if options.kind else [*KINDS, COMMANDS]
    table, console = Table("kind of input"), Console(width=120, highlight=False)
    for name in ("tried", "ran", "refused", "failed", "ms each", "slowest, s"):
        table.add_column(name, justify="right")
    # An empty folder, so that what an input leaves behind is seen.
    with tempfile.TemporaryDirectory() as empty, contextlib.chdir(empty):
        wrong = report(
            kinds, options.examples // max(1, len(set(kinds) - {COMMANDS})), options.seed, table, console
        )
    console.print(table)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
