"""What a run's result is, and how `result.json` is written and read: here and nowhere else. No torch."""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ship_trl.files.disk import read_json, replacing

RESULT = "result.json"
# Goes up when a key is added, renamed or means something else. 1, before it was written down, called
# `config_hash` `recipe`; what it lacked has a default below.
SCHEMA_VERSION = 3
RENAMED = {"recipe": "config_hash"}


class ResultError(Exception):
    """No result, or one that is not whole; its text says which key is wrong, in a few words."""


@dataclass(frozen=True)
class Evaluation:
    """One greedy episode.

    `episode_return` is the undiscounted sum of raw rewards (`return` in the file), `outcome` goal,
    collision or timeout, `length` in steps of a second, `dcpa` the least distance to a target ship in
    metres (None without target ships), `episode` after how many training episodes it was sailed.
    """

    episode_return: float
    outcome: str
    length: int
    dcpa: float | None
    episode: int


@dataclass(frozen=True)
class Result:
    """What a run did and reached; returns are of raw rewards.

    `config_hash` says by which settings, `source_network` with whose weights; `scratch` is what an
    untrained network scored, `before` the network that training began with, `best` and `final` the kept
    ones; `draws` are returns before training over draws of the layers that are not copied; `precision` and
    `backend` are those of the conv layers while it learned. `steps` are of
    the environment; goal and collision rate are shares of the training episodes.
    """

    pair: str
    source: str | None
    target: str
    method: str
    layers: int | str | None
    arm: str
    seed: int
    profile: str
    config_hash: str
    source_network: str | None
    best_known_return: float
    scratch: Evaluation
    before: Evaluation
    best: Evaluation
    final: Evaluation
    episodes: int
    steps: int
    training_goal_rate: float
    training_collision_rate: float
    device: str
    ship_trl: str
    torch: str
    processor: str
    seconds: float
    # Not in the oldest results.
    random_return: float | None = None
    draws: list[float] = field(default_factory=list)
    precision: str | None = None
    backend: str | None = None
    algorithm_version: int = 0
    schema_version: int = 1

    @property
    def title(self) -> str:
        """One line for people."""
        start = "" if self.source is None else f"case {self.source} -> "
        return f"{start}case {self.target}, {self.arm}, seed {self.seed}"

    def to_json(self) -> dict[str, Any]:
        """Give it as it stands in the file."""
        values = dataclasses.asdict(self)
        for key, value in values.items():
            if isinstance(getattr(self, key), Evaluation):
                values[key] = {"return": value.pop("episode_return")} | value
        return values


def from_json(values: Any) -> Result:
    """Make a result of what stands in a file, of this schema or an older one.

    Raises:
        ResultError: a key is missing or holds something else than it should.
    """
    if not isinstance(values, dict):
        raise ResultError("is not a result of this program")
    values = typing.cast("dict[str, Any]", values)
    given = {RENAMED.get(key, key): value for key, value in values.items()}
    version = given.get("schema_version", 1)
    if not is_whole(version) or not 1 <= version <= SCHEMA_VERSION:
        known = f"; up to {SCHEMA_VERSION} can be read"
        raise ResultError(
            f"has schema_version {version}{known}"
            if is_whole(version)
            else "holds no whole number in schema_version"
        )
    found: Result = _typed(Result, given, "")
    return found


def _typed(schema: Any, given: dict[str, Any], where: str) -> Any:
    """Make a dataclass of values, each checked against its type; further keys are passed over."""
    hints = typing.get_type_hints(schema)
    values = {}
    for entry in dataclasses.fields(schema):
        key = "return" if entry.name == "episode_return" else entry.name
        if key not in given:
            required = entry.default is dataclasses.MISSING and entry.default_factory is dataclasses.MISSING
            if required:
                raise ResultError(f"has no {where}{key}")
            continue
        value, kind = given[key], hints[entry.name]
        if kind is Evaluation:
            if not isinstance(value, dict):
                raise ResultError(f"has no {where}{key}")
            values[entry.name] = _typed(Evaluation, value, f"{key}.")
        elif _fits(value, kind):
            values[entry.name] = float(value) if kind is float else value
        else:
            raise ResultError(f"holds no {_name(kind)} in {where}{key}")
    return schema(**values)


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value of JSON is of a type; numbers are finite, and whole ones are floats too."""
    if isinstance(kind, types.UnionType):
        return any(_fits(value, one) for one in typing.get_args(kind))
    if typing.get_origin(kind) is list:
        return isinstance(value, list) and all(_fits(one, typing.get_args(kind)[0]) for one in value)
    if kind is float:
        try:
            return type(value) in (int, float) and math.isfinite(value)
        except OverflowError:
            return False
    if kind is int:
        return is_whole(value)
    # Control characters would reach a terminal.
    return type(value) is kind and (kind is not str or value.isprintable())


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number of at most 63 bits, as all that count are."""
    return type(value) is int and abs(value) < 2**63


def _name(kind: Any) -> str:
    """Name a type for people."""
    if typing.get_origin(kind) is list:
        return "list of numbers"
    kinds = [one for one in typing.get_args(kind) if one is not types.NoneType] or [kind]
    words = {float: "number", int: "whole number", str: "text"}
    return words[kinds[0]]


def read_result(folder: Path) -> Result:
    """Read a run's result.

    Raises:
        ResultError: there is none, or it is not whole.
    """
    try:
        values = read_json(folder / RESULT)
    except FileNotFoundError:
        raise ResultError("is missing") from None
    except (OSError, ValueError):
        raise ResultError("cannot be read") from None
    return from_json(values)


def write_result(folder: Path, result: Result) -> None:
    """Write a run's result beside and rename it."""
    with replacing(folder / RESULT) as draft:
        draft.write_text(json.dumps(result.to_json(), indent=1))
