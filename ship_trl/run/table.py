"""Print tables to a terminal, to a file or as Markdown; no cell is ever cut. No torch."""

from __future__ import annotations

import sys
from collections.abc import Container, Iterable, Iterator, Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Column, Table

from ship_trl.config.errors import one_line

# Blank characters between two columns, and the least characters of a line.
GAP, MIN_WIDTH = 2, 40


def show(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    markdown: bool = False,
    title: str | None = None,
    names: int = 1,
    shown: Container[str] | None = None,
) -> None:
    """Print the `shown` columns of a table, or all, with a title above.

    A table that is too wide for the terminal is printed in parts; each begins with the first `names` columns,
    which identify the rows. Only a cell that is wider than a whole line is wrapped, between words. A file or
    a pipe has lines of any length.
    """
    kept = [k for k, heading in enumerate(headings) if shown is None or heading in shown]
    # Names from foreign files must not control a terminal.
    headings, *rows = ([one_line(cells[k]) for k in kept] for cells in (headings, *rows))
    if markdown:
        lines = (headings, ["---"] * len(headings), *rows)
        above = f"{title}\n\n" if title else ""
        sys.stdout.write(above + "".join(f"| {' | '.join(row)} |\n" for row in lines) + "\n")
        return
    console = Console(highlight=False, markup=False)
    columns = [list(column) for column in zip(headings, *rows, strict=True)]
    whole = [max(map(cell_len, column)) for column in columns]
    in_a_line = max(sum(whole) + GAP * len(whole), cell_len(title or ""), MIN_WIDTH)
    console.width = max(console.width, MIN_WIDTH) if console.is_terminal else in_a_line
    for part, widths in split(columns, whole, console.width, names):
        some = [Column(columns[k][0], width=width) for k, width in zip(part, widths, strict=True)]
        table = Table(*some, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
        for row in rows:
            table.add_row(*(row[k] for k in part))
        if title:
            console.print(title)
        console.print(table)
        console.print()
        title = None


def split(
    columns: Sequence[Sequence[str]], whole: Sequence[int], limit: int, names: int
) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the columns of each part of a table, and their widths.

    `columns` have a heading, then cells; `whole` are their widths, and a line has `limit` characters.
    """
    if sum(whole) + GAP * (len(whole) - 1) <= limit:
        yield list(range(len(whole))), list(whole)
        return
    # Headings are wrapped between words.
    widths = [max(map(cell_len, (*head.split(), *cells))) for head, *cells in columns]
    # Long names leave half of the line to the others.
    first = [min(width, limit // 2 // names) for width in widths[:names]]
    room = limit - sum(first) - GAP * names
    part: list[int] = []
    used: list[int] = []
    for k, width in enumerate(widths[names:], names):
        width = min(width, room)
        if part and sum(used) + GAP * len(used) + width > room:
            yield [*range(names), *part], [*first, *used]
            part, used = [], []
        part.append(k)
        used.append(width)
    yield [*range(names), *part], [*first, *used]
