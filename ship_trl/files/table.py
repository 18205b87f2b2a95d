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
        return [make(cells) for _, cells in rows(read_file(path, most), columns)]
    except OSError as error:
        raise ConfigError(f"{given_as}: {path} cannot be read: {error.strerror}") from None
    except (ValueError, ConfigError) as error:
        raise ConfigError(f"{given_as}: {path} is not {kind}: {error}") from None


def rows(data: bytes, columns: Sequence[str]) -> list[tuple[int, Cells]]:
    """Parse a table, with commas or semicolons, into rows of text cells, each with its line's number.

    A first line that begins with # is left out.

    Raises:
        ValueError: it is not CSV or has other columns.
    """
    text = data.decode("utf-8-sig")
    comment = text[: text.find("\n") + 1] if text.startswith("#") else ""
    text = text[len(comment) :]
    heading = text.partition("\n")[0]
    delimiter = ";" if ";" in heading and "," not in heading else ","
    table = csv.DictReader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
    try:
        missing = [name for name in columns if name not in (table.fieldnames or ())]
        found = [(table.line_num + bool(comment), row) for row in table]
    except csv.Error as error:
        raise ValueError(str(error)) from None
    if len(set(table.fieldnames or ())) < len(table.fieldnames or ()):
        raise ValueError("it has a column twice")
    if missing:
        raise ValueError(f"it has no column {missing[0]!r}")
    for line, row in found:
        # csv fills missing cells with None, and collects surplus cells under the key None.
        if None in row or None in row.values():
            raise ValueError(f"line {line} has more or fewer cells than there are columns")
    return found
