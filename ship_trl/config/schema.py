"""Read values of YAML, JSON or a command line as types with bounds. No torch.

A field says what it allows: `gamma: Annotated[float, limit(0, 1)]`. All settings and files of values are read
here. Pydantic would still need OmegaConf, and its import makes a refusal half as slow again.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable
from dataclasses import MISSING, dataclass
from enum import Enum
from functools import cache
from typing import Annotated, Any, TypeVar

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.errors import ConfigError, explain

# The largest integer that torch and the files of a run can hold.
MAX_INTEGER = 2**63 - 1
TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
TYPE_NAMES: dict[Any, str] = {
    int: "a whole number",
    float: "a finite number",
    bool: "true or false",
    str: "plain text",
    Any: "a single value",
}

T = TypeVar("T")


@dataclass(frozen=True)
class Rule:
    """What a field allows beyond its type: words for people, and the test."""

    allowed: str
    test: Callable[[Any], bool]


def limit(
    low: float | None = None, high: float | None = None, *, above: float | None = None, note: str = ""
) -> Rule:
    """Make the rule of a number that is at least `low`, or above `above`, and at most `high`."""
    is_range = low is not None and high is not None
    ends = (
        ("from" if is_range else "at least", low),
        ("above", above),
        ("to" if is_range else "at most", high),
    )
    words = [f"{word} {end if type(end) is int else f'{end:g}'}" for word, end in ends if end is not None]
    allowed = (" " if is_range else " and ").join(words) + (f" ({note})" if note else "")
    least, beyond, most = -math.inf if low is None else low, above, math.inf if high is None else high
    return Rule(allowed, lambda value: least <= value <= most and (beyond is None or value > beyond))


def read_as(schema: type[T], values: object, where: str = "", *, key: str = "", from_json: bool = False) -> T:
    """Read values as the dataclass `schema`.

    Args:
        schema: its fields may be numbers, text, enums, dataclasses, and lists, dicts and unions of them, with
            rules behind `Annotated`. The metadata `key` of a field is its name in the file.
        values: plain, or of OmegaConf, whose interpolations are resolved.
        where: prefix of an error, such as the name of a file.
        key: the full key of the values in the file; empty for the whole file.
        from_json: text is not converted to numbers, nor numbers to text; unknown keys are ignored.

    Raises:
        ConfigError: a key is unknown, missing or wrong, or an interpolation has no value. It names the key.
    """
    if isinstance(values, DictConfig | ListConfig):
        try:
            values = OmegaConf.to_container(values, resolve=True)
        except OmegaConfBaseException as error:
            raise ConfigError(where + explain(error)) from None
        except RecursionError:
            raise ConfigError(f"{where}config: interpolations lead to themselves") from None
    found: T = Reader(where, from_json).read(schema, values, key)
    return found


@dataclass(frozen=True)
class Reader:
    """Reads values one by one; see `read_as` for `where` and `from_json`."""

    where: str = ""
    from_json: bool = False

    def read(self, hint: Any, value: Any, key: str) -> Any:
        """Return the value of a key as a type, or raise a `ConfigError`."""
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if origin is Annotated:
            kind, *rules = arguments
            found = self.read(kind, value, key)
            for rule in rules:
                if not rule.test(found):
                    self.refuse(key, rule.allowed, value)
            return found
        if origin in (types.UnionType, typing.Union):
            return self.read_union(arguments, value, key)
        return self.read_plain(hint, value, key)

    def read_plain(self, hint: Any, value: Any, key: str) -> Any:
        """Return a value as a type without rules and alternatives."""
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if value == "???" and not self.from_json:
            raise ConfigError(f"{self.where}{key}: missing; a value is needed")
        if dataclasses.is_dataclass(hint):
            return self.read_group(hint, value, key)
        if origin is list and isinstance(value, list):
            return [self.read(arguments[0], one, f"{key}[{n}]") for n, one in enumerate(value)]
        if origin is dict and isinstance(value, dict):
            return {str(name): self.read(arguments[1], one, f"{key}.{name}") for name, one in value.items()}
        if type(value) is int and abs(value) > MAX_INTEGER:
            self.refuse(key, f"at most {MAX_INTEGER} in size", value)
        found = value if hint is Any else self.convert(hint, value)
        if found is None and hint is not Any:
            quotes = ", in quotes" if hint is str and type(value) in (bool, float) else ""
            self.refuse(key, name_of(hint) + quotes, value)
        return found

    def refuse(self, key: str, allowed: str, value: object) -> None:
        """Raise a `ConfigError` that names the key, what is allowed and what was given."""
        got = repr(value) if self.from_json and isinstance(value, str) else show(value)
        name = f"{key}: " if key else ""
        raise ConfigError(f"{self.where}{name}must be {allowed}, got {got}")

    def read_union(self, kinds: tuple[Any, ...], value: Any, key: str) -> Any:
        """Return a value as the first of several types that accepts it."""
        if value is None and types.NoneType in kinds:
            return None
        *others, last = [kind for kind in kinds if kind is not types.NoneType]
        for kind in others:
            try:
                return self.read(kind, value, key)
            except ConfigError:
                continue
        return self.read(last, value, key)

    def read_group(self, schema: Any, values: Any, key: str) -> Any:
        """Return a dict as a dataclass."""
        fields = fields_of(schema)
        if not isinstance(values, dict):
            self.refuse(key, name_of(schema), values)
        prefix = f"{key}." if key else ""
        if not self.from_json and (unknown := [name for name in values if name not in fields]):
            allowed = ", ".join(fields) or "none"
            raise ConfigError(f"{self.where}{prefix}{unknown[0]}: unknown key; allowed here: {allowed}")
        found = {}
        for name, (field, hint) in fields.items():
            if name in values:
                found[field.name] = self.read(hint, values[name], prefix + name)
            elif field.default is MISSING and field.default_factory is MISSING:
                raise ConfigError(f"{self.where}{prefix}{name}: missing; a value is needed")
        return schema(**found)

    def convert(self, kind: Any, value: Any) -> Any:
        """Return a single value as a type, or None if it does not fit."""
        is_text = isinstance(value, str)
        try:
            if kind is float and (type(value) in (int, float) or (is_text and not self.from_json)):
                number = float(value)
                return number if math.isfinite(number) else None
            if kind is int and is_text and not self.from_json:
                value = int(value)
        except (ValueError, OverflowError):
            return None
        if kind is int:
            return value if type(value) is int and abs(value) <= MAX_INTEGER else None
        if kind is bool and not self.from_json:
            word = str(value).lower()
            return True if word in TRUE else False if word in FALSE else None
        if kind is str:
            if self.from_json:
                # Control characters would reach a terminal.
                return value if is_text and value.isprintable() else None
            # Of a name such as 1e3 or 7.50 only a number would be left.
            return str(value) if type(value) in (str, int) else None
        if isinstance(kind, type) and issubclass(kind, Enum):
            return value if isinstance(value, kind) else kind.__members__.get(str(value))
        return value if type(value) is kind else None


@cache
def fields_of(schema: Any) -> dict[str, tuple[dataclasses.Field[Any], Any]]:
    """Return the field and the type of each key of a dataclass."""
    hints = typing.get_type_hints(schema, include_extras=True)
    fields: tuple[dataclasses.Field[Any], ...] = dataclasses.fields(schema)
    return {field.metadata.get("key", field.name): (field, hints[field.name]) for field in fields}


def name_of(hint: Any) -> str:
    """Return the words of a message for a type."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return f"a group of {', '.join(fields_of(hint))}"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return f"one of {', '.join(hint.__members__)}"
    if typing.get_origin(hint) is list:
        is_nested = "list[" in str(typing.get_args(hint)[0])
        return "a list of lists, as [[A,B],[C,D]]" if is_nested else "a list, as [A,B] or []"
    return TYPE_NAMES.get(hint, "a group")


def show(value: object) -> str:
    """Return a value as YAML writes it."""
    if value is None or value == "" or isinstance(value, bool):
        return {None: "null", "": "''", True: "true", False: "false"}[value]
    try:
        return str(value)
    except ValueError:  # Python does not print integers of thousands of digits
        return "an integer of thousands of digits"
