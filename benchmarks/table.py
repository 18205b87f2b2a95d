"""Write measurements: a table on the terminal, a JSON file for programs."""

from __future__ import annotations

import dataclasses
import json
import statistics
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.timing import Measurement
from ship_trl.files.disk import atomic_write

# Group, name and unit are text; the columns after them are numbers.
COLUMNS = ("group", "name", "unit", "median", "range", "of first", "ours is")
TEXT_COLUMNS = 3
# Wide enough that rich wraps no line of Markdown.
MARKDOWN_WIDTH = 200


@dataclasses.dataclass(frozen=True)
class Row:
    """A measurement beside others of its group.

    `of_first` is its value over that of the group's first row, None in that row itself. `ours_is` is the
    value of the group's first row of ship_trl over this peer's, None where there is none. Both are medians
    of the ratios of the rounds.
    """

    part: str
    measured: Measurement
    of_first: float | None
    ours_is: float | None

    def cells(self) -> list[str]:
        """Return the text of its cells, one for each of `COLUMNS`."""
        one, values = self.measured, self.measured.values
        spread = f"{short(min(values))}..{short(max(values))}" if len(values) > 1 else ""
        ratios = ["" if value is None else f"{value:.2f}x" for value in (self.of_first, self.ours_is)]
        return [one.group, one.name, one.unit, short(one.median), spread, *ratios]


def short(value: float) -> str:
    """Return a number with three significant digits, and k, M or G."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:.3g}{letter}" if value < 999.5 * size else f"{value / size:.0f}{letter}"
    return f"{value:.3g}"


def ratio(above: Measurement, below: Measurement) -> float:
    """Return the median over the rounds of one measurement's value over another's."""
    return statistics.median(a / b for a, b in zip(above.values, below.values, strict=True))


def compare(part: str, measured: Sequence[Measurement]) -> list[Row]:
    """Compare measurements with the others of their group and unit."""
    rows = []
    for one in measured:
        group = [other for other in measured if (other.group, other.unit) == (one.group, one.unit)]
        ours = next((other for other in group if other.is_ours), None)
        of_first = None if one is group[0] else ratio(one, group[0])
        rows.append(Row(part, one, of_first, ratio(ours, one) if ours and not one.is_ours else None))
    return rows


def print_table(title: str, rows: Sequence[Row], markdown: bool) -> None:
    """Print rows without the columns that are empty; a new group begins below a line."""
    lines = [row.cells() for row in rows]
    kept = [k for k in range(len(COLUMNS)) if any(line[k] for line in lines)]
    table = Table(title=title, title_justify="left", box=box.MARKDOWN if markdown else box.HEAVY_HEAD)
    for k in kept:
        table.add_column(COLUMNS[k], justify="left" if k < TEXT_COLUMNS else "right")
    for line, following in zip(lines, [*lines[1:], lines[-1]], strict=True):
        ends_group = line[0] != following[0] and not markdown
        table.add_row(*(line[k] for k in kept), end_section=ends_group)
    Console(highlight=False, width=MARKDOWN_WIDTH if markdown else None).print(table)


def write_json(path: Path, machine: str, rows: Sequence[Row]) -> None:
    """Write the machine and all rows, with the value of every round."""
    content = {"machine": machine, "rows": [dataclasses.asdict(row) for row in rows]}
    with atomic_write(path) as draft:
        draft.write_text(json.dumps(content, indent=1) + "\n")
