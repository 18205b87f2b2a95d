"""Print tables to a terminal, to a file or as Markdown."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Column, Table

# Characters in a line of a file or a pipe, so that no row is wrapped.
FILE_WIDTH = 1_000


def show(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    markdown: bool = False,
    title: str | None = None,
) -> None:
    """Print a table, with a title above unless it is Markdown."""
    rows = list(rows)
    if markdown:
        lines = (headings, ["---"] * len(headings), *rows)
        sys.stdout.write("".join(f"| {' | '.join(row)} |\n" for row in lines) + "\n")
        return
    # The first column identifies the rows, so it is never cut.
    first = Column(headings[0], no_wrap=True, min_width=max((len(row[0]) for row in rows), default=0))
    table = Table(first, *headings[1:], title=title, title_justify="left")
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = FILE_WIDTH
    console.print(table)
