"""Read untrusted CSV tables, or refuse them in one line."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import read_file

Cells = dict[str, str]
Row = TypeVar("Row")


def read_table(
    path: Path, columns: Sequence[str], make: Callable[[Cells], Row], most: int, given_as: str, kind: str
) -> list[Row]:
    """Read a table with at least these columns and at most `most` bytes, or raise a ConfigError.

    `make` converts the text cells of a row, and raises ValueError or ConfigError for a wrong one. Messages
    name the option or argument `given_as`, and the `kind` of table, such as "a table of layers".
    """
    try:
        return [make(cells) for cells in rows(read_file(path, most), columns)]
    except OSError as error:
        raise ConfigError(f"{given_as}: {path} cannot be read: {error.strerror}") from None
    except (ValueError, ConfigError) as error:
        raise ConfigError(f"{given_as}: {path} is not {kind}: {error}") from None


def rows(data: bytes, columns: Sequence[str]) -> list[Cells]:
    """Parse a table into rows of text cells; raise ValueError if it is not CSV or has other columns."""
    table = csv.DictReader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
    try:
        missing = [name for name in columns if name not in (table.fieldnames or ())]
        found = list(table)
    except csv.Error as error:
        raise ValueError(str(error)) from None
    if len(set(table.fieldnames or ())) < len(table.fieldnames or ()):
        raise ValueError("it has a column twice")
    if missing:
        raise ValueError(f"it has no column {missing[0]!r}")
    # csv fills missing cells with None, and collects surplus cells under the key None.
    if any(None in row or None in row.values() for row in found):
        raise ValueError("a row has more or fewer cells than there are columns")
    return found
