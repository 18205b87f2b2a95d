"""Where single values, lists and groups stand in a configuration or a case, and where numbers are too large to be any.

OmegaConf checks types, but of these it does not say where they stand, or takes them.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any

from ship_trl.config import ConfigError

# Beyond it is no integer of the files that are written, nor of torch.
LARGEST_INTEGER = 2**63 - 1


def check_shapes(schema: Any, values: Any, where: str = "", key: str = "") -> None:
    """Check plain values against a type, from the outside in; what is no list or group is OmegaConf's to check.

    Args:
        schema: a dataclass, or the type of one of its fields.
        values: dicts, lists and single values, with interpolations as they were written.
        where: begins a complaint, as the name of a file.
        key: full name of the values; empty for those of a whole file.

    Raises:
        ConfigError: a list or a group where there should be none, or none where there should be one, or an
            integer of more than 63 bits.
    """

    def need(right: bool, allowed: str) -> None:
        if not right:
            raise ConfigError(f"{where}{key}: must be {allowed}, got {shown(values)}")

    if isinstance(schema, types.UnionType):
        schema = next(one for one in typing.get_args(schema) if one is not types.NoneType)
    if values is None or schema is Any:
        return
    written = isinstance(values, str) and ("${" in values or values == "???")
    if type(values) is int:
        need(abs(values) <= LARGEST_INTEGER, f"at most {LARGEST_INTEGER} in size")
    if typing.get_origin(schema) is list:
        (inner,) = typing.get_args(schema)
        rows = "a list of lists" if typing.get_origin(inner) is list else "a list"
        need(written or isinstance(values, list), rows)
        for index, value in enumerate(values if isinstance(values, list) else ()):
            check_shapes(inner, value, where, f"{key}[{index}]")
    elif dataclasses.is_dataclass(schema):
        hints = typing.get_type_hints(schema)
        need(written or isinstance(values, dict), f"a group of {', '.join(hints)}")
        for name, value in values.items() if isinstance(values, dict) else ():
            # Of a name that is unknown it is said elsewhere which there are.
            if name in hints:
                check_shapes(hints[name], value, where, f"{key}.{name}" if key else str(name))
    elif typing.get_origin(schema) is not dict:
        need(not isinstance(values, dict | list), "a single value")


def shown(value: object) -> str:
    """Show a value; an integer of thousands of digits has no decimal form."""
    try:
        return str(value)
    except ValueError:
        return "one of thousands of digits"
