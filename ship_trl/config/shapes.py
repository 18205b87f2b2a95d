"""Where single values, lists and groups stand in a configuration or a case, and which integers are too large.

OmegaConf checks types, but of these it does not say where they stand, or takes them.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any

from ship_trl.config.errors import ConfigError

# Beyond it is no integer of the files that are written, nor of torch.
LARGEST_INTEGER = 2**63 - 1


def check_shapes(schema: Any, values: Any, where: str = "", key: str = "") -> None:
    """Check plain values against a type, from the outside in; what is left to check is OmegaConf's.

    Args:
        schema: a dataclass, or the type of one of its fields.
        values: dicts, lists and single values, with interpolations as they were written.
        where: begins a complaint, as the name of a file.
        key: full name of the values; empty for those of a whole file.

    Raises:
        ConfigError: a list or a group where there should be none, or none where there should be one, or an
            integer of more than 63 bits.
    """
    if isinstance(schema, types.UnionType):
        schema = next(one for one in typing.get_args(schema) if one is not types.NoneType)
    allowed = allowed_shape(schema, values)
    if allowed is not None:
        raise ConfigError(f"{where}{key}: must be {allowed}, got {shown(values)}")
    if isinstance(values, list) and typing.get_origin(schema) is list:
        for index, value in enumerate(values):
            check_shapes(typing.get_args(schema)[0], value, where, f"{key}[{index}]")
    if isinstance(values, dict) and dataclasses.is_dataclass(schema):
        hints = typing.get_type_hints(schema)
        # Of a name that is unknown it is said elsewhere which there are.
        for name in [name for name in values if name in hints]:
            check_shapes(hints[name], values[name], where, f"{key}.{name}" if key else str(name))


def allowed_shape(schema: Any, value: Any) -> str | None:
    """Say what is allowed in place of a value, or None where it has the right shape, whatever is inside."""
    if type(value) is int and abs(value) > LARGEST_INTEGER:
        return f"at most {LARGEST_INTEGER} in size"
    if schema in (int, float) and type(value) is bool:
        return "a number"
    written = isinstance(value, str) and ("${" in value or value == "???")
    if value is None or written or schema is Any:
        return None
    if typing.get_origin(schema) is dict:
        return None if isinstance(value, dict) else "a group"
    if typing.get_origin(schema) is list:
        rows = typing.get_origin(typing.get_args(schema)[0]) is list
        return None if isinstance(value, list) else "a list of lists" if rows else "a list"
    if dataclasses.is_dataclass(schema):
        names = ", ".join(entry.name for entry in dataclasses.fields(schema))
        return None if isinstance(value, dict) else f"a group of {names}"
    return "a single value" if isinstance(value, dict | list) else None


def shown(value: object) -> str:
    """Show a value; an integer of thousands of digits has no decimal form."""
    try:
        return str(value)
    except ValueError:
        return "one of thousands of digits"
