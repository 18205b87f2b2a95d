"""Read untrusted files, YAML as plain values and CSV tables, or refuse them; see SECURITY.md. No torch."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf._utils import get_yaml_loader
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import read_file

Cells = dict[str, str]
Row = TypeVar("Row")
# A run's configuration has 2,000 bytes, a case of eight ships 700.
MAX_YAML_BYTES = 64_000
# A configuration has four levels of lists and mappings.
MAX_YAML_DEPTH = 50
# What plain numbers look like. YAML 1.1 would also read 045 in base 8 and 3:30 in base 60.
NUMBERS = {
    "tag:yaml.org,2002:int": r"-?(0|[1-9][0-9]*)$",
    "tag:yaml.org,2002:float": r"[-+]?([0-9]+\.[0-9]*|\.[0-9]+|[0-9]+(?=e))(e[-+]?[0-9]+)?$|-?\.(inf|nan)$",
}


def decimal_loader() -> Any:
    """Make OmegaConf's loader of YAML, with decimal numbers alone.

    A word such as 045, 1_0 or 3:30 stays text: `read_as` makes a number of it where the key is one.
    """
    loader = get_yaml_loader()
    loader.yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag not in NUMBERS]
        for first, resolvers in loader.yaml_implicit_resolvers.items()
    }
    for tag, pattern in NUMBERS.items():
        loader.add_implicit_resolver(tag, re.compile(pattern, re.IGNORECASE), list("-+.0123456789"))
    return loader


LOADER = decimal_loader()


def read_changes(words: Iterable[str]) -> DictConfig:
    """Read words such as "turn_time=4" or "pairs=[high,low]" as OmegaConf does, with decimal numbers."""
    changes = OmegaConf.create()
    for key, _, text in (word.partition("=") for word in words):
        OmegaConf.update(changes, key, LOADER(text).get_single_data())
    return changes


def read_yaml(path: Path) -> DictConfig | ListConfig:
    """Read a YAML file as OmegaConf does, with decimal numbers, without interpolations and aliases.

    OmegaConf's loader is a `yaml.SafeLoader`, which makes no Python objects. But `${oc.env:NAME}` would copy
    this machine's environment into output and files, and a few aliases can stand for billions of values.

    Raises:
        yaml.YAMLError: it is not YAML, too deep, or has an interpolation or an alias.
        OSError: it cannot be read, or is too large.
    """
    data = read_file(path, MAX_YAML_BYTES)
    try:
        text = data.decode()
        refuse_more_than_values(text)
        values = LOADER(text).get_single_data()
        if not isinstance(values, dict | list | None):
            raise yaml.YAMLError("a single value")
        return OmegaConf.create(values or {})
    except (OmegaConfBaseException, ValueError, LookupError, TypeError, AttributeError) as error:
        # PyYAML raises Python's own errors, for example for no UTF-8, or `!!int x`.
        raise yaml.YAMLError(str(error)) from None


def refuse_more_than_values(text: str) -> None:
    """Raise a YAMLError for interpolations (escaped ones too), aliases, deep nesting, or other text."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        line = event.start_mark.line + 1 if event.start_mark else 0
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_YAML_DEPTH:
            raise yaml.YAMLError(f"line {line}: nested too deeply")
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f"line {line}: no alias (*{event.anchor}) is allowed")
        if isinstance(event, yaml.ScalarEvent) and "${" in event.value:
            raise yaml.YAMLError(f"line {line}: no interpolation (${{...}}) is allowed")


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
