"""Read values of YAML, JSON or a command line as types with bounds, by pydantic. No torch.

A field says what it allows: `gamma: Annotated[float, Field(ge=0, le=1)]`. All settings and files of values
are read here, so that each refusal is one line that names the key and what is allowed.
"""

from __future__ import annotations

import dataclasses
import json
import re
import types
import typing
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, TypeVar

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import AfterValidator, ConfigDict, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from ship_trl.config.errors import ConfigError, explain

T = TypeVar("T")
# The largest integer that torch and the files of a run can hold.
MAX_INTEGER = 2**63 - 1
# Names in files are often numbers, as cases are; infinity and NaN are no values.
READING = ConfigDict(coerce_numbers_to_str=True, allow_inf_nan=False)


def rule(allowed: str, test: Callable[[Any], bool]) -> AfterValidator:
    """Make a rule of a field from words for people and a test."""

    def check(value: T) -> T:
        if not test(value):
            raise PydanticCustomError("rule", "{allowed}", {"allowed": allowed})
        return value

    return AfterValidator(check)


def read_as(hint: type[T], values: object, where: str = "", *, key: str = "", from_json: bool = False) -> T:
    """Read values as a type: a dataclass of numbers, text, enums, dataclasses, lists and dicts of them.

    Args:
        hint: a dataclass, or the type of a single value.
        values: plain, or of OmegaConf, whose interpolations are resolved.
        where: prefix of an error, such as the name of a file.
        key: the full key of the values in the file; empty for the whole file.
        from_json: text is not converted to numbers, nor numbers to text; unknown keys are ignored.

    Raises:
        ConfigError: a key is unknown, missing or wrong, or an interpolation has no value. It names the key.
    """
    if isinstance(values, DictConfig | ListConfig):
        try:
            values = OmegaConf.to_container(values, resolve=True, throw_on_missing=True)
        except OmegaConfBaseException as error:
            raise ConfigError(where + explain(error)) from None
    kind: Any = hint
    try:
        if from_json:
            # Strict about Python's values, pydantic takes no dict for a dataclass; of JSON it does.
            found = adapter_of(kind).validate_json(json.dumps([values]), strict=True, extra="ignore")
        elif wrong := bool_for_number(hint, values):
            raise ConfigError(where + explain_invalid(hint, key, wrong))
        else:
            found = adapter_of(kind).validate_python([values], extra="forbid")
    except ValidationError as error:
        raise ConfigError(where + explain_invalid(hint, key, error.errors()[0])) from None
    return found[0]


@cache
def adapter_of(hint: Any) -> TypeAdapter[Any]:
    """Return the validator of a list of a type: a dataclass alone would not take `READING`."""
    one: Any = types.GenericAlias(list, (hint,))
    return TypeAdapter(one, config=READING)


def bool_for_number(hint: Any, values: Any, path: tuple[Any, ...] = ()) -> dict[str, Any] | None:
    """Return an error as pydantic's for the first true or false where a number belongs: it reads 1 or 0."""
    if isinstance(values, bool):
        is_number = unwrap(hint_at(hint, path)) in (int, float)
        return {"loc": (0, *path), "type": "bool", "msg": "a number", "input": values} if is_number else None
    lists = enumerate(values if isinstance(values, list) else ())
    within = values.items() if isinstance(values, dict) else lists
    found = (bool_for_number(hint, value, (*path, part)) for part, value in within)
    return next((error for error in found if error), None)


def explain_invalid(hint: Any, key: str, error: Any) -> str:
    """Explain an error of pydantic in one line: the full key, then what is allowed."""
    # The first place is that in the list of one.
    path, got = error["loc"][1:], error["input"]
    name = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    name = (key + name).lstrip(".")
    if error["type"] == "missing":
        return f"{name}: missing; a value is needed"
    if error["type"] == "unexpected_keyword_argument":
        return f"{name}: unknown key; allowed here: {', '.join(keys_at(hint, path[:-1])) or 'none'}"
    allowed = re.sub(r"^Input should be |, (unable to|got a) .*", "", error["msg"])
    if error["type"] == "dataclass_type":
        allowed = f"a group of {', '.join(keys_at(hint, path)) or 'keys'}"
    return f"{name}: must be {allowed}, got {json.dumps(got, default=str)}".removeprefix(": ")


def hint_at(hint: Any, path: tuple[Any, ...]) -> Any:
    """Return the type at a path of keys and indices in a type."""
    for part in path:
        group = unwrap(hint)
        if dataclasses.is_dataclass(group):
            hint = typing.get_type_hints(group, include_extras=True).get(part)
        else:
            hint = (typing.get_args(group) or (None,))[-1]
    return hint


def unwrap(hint: Any) -> Any:
    """Return the type inside bounds; of `X | None` it is X."""
    while typing.get_origin(hint) in (typing.Union, types.UnionType, Annotated):
        hint = typing.get_args(hint)[0]
    return hint


def keys_at(hint: Any, path: tuple[Any, ...] = ()) -> list[str]:
    """List the keys of a dataclass, or of the group at a path in it."""
    group = unwrap(hint_at(hint, path))
    return [field.name for field in dataclasses.fields(group)] if dataclasses.is_dataclass(group) else []
