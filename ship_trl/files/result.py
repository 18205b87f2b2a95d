"""What a run's result is, and the only reader and writer of `result.json`. No torch."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import limit, read_as
from ship_trl.files.disk import atomic_write, read_json

RESULT = "result.json"
# Goes up when a key is added, renamed or changes its meaning.
SCHEMA_VERSION = 3
# Schema 1, which the files did not state yet, called `config_hash` so.
RENAMED = {"recipe": "config_hash"}


class ResultError(Exception):
    """A result that is missing or damaged; its text follows the file's name, and says what is wrong."""


@dataclass(frozen=True)
class Evaluation:
    """One greedy episode.

    `episode_return` is the undiscounted sum of raw rewards (`return` in the file), `outcome` goal, collision
    or timeout, `length` in steps of a second, `dcpa` the least distance to a target ship in metres (None
    without target ships), `episode` the number of training episodes before it.
    """

    episode_return: float = field(metadata={"key": "return"})
    outcome: str
    length: int
    dcpa: float | None
    episode: int


@dataclass(frozen=True)
class Result:
    """What a run did and reached; returns are of raw rewards.

    `config_hash` is a digest of the settings, `source_network` names the source's weights. `scratch` is the
    evaluation of an untrained network, `before` that of the network that training began with, `best` and
    `final` those of the kept ones; `draws` are returns before training with other draws of the fresh layers.
    `precision` and `backend` are those of the conv layers in training. `steps` are environment steps, goal
    and collision rate shares of the training episodes.
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
    # The oldest results lack what has a default.
    random_return: float | None = None
    draws: list[float] = field(default_factory=list)
    precision: str | None = None
    backend: str | None = None
    algorithm_version: int = 0
    schema_version: Annotated[int, limit(1, SCHEMA_VERSION)] = 1

    @property
    def title(self) -> str:
        """Return one line for people."""
        start = "" if self.source is None else f"case {self.source} -> "
        return f"{start}case {self.target}, {self.arm}, seed {self.seed}"

    def to_json(self) -> dict[str, Any]:
        """Return the values that the file holds."""
        values = dataclasses.asdict(self)
        for key, value in values.items():
            if isinstance(getattr(self, key), Evaluation):
                values[key] = {"return": value.pop("episode_return")} | value
        return values


def from_json(values: Any) -> Result:
    """Make a result of a file's values, of this schema or an older one.

    Raises:
        ResultError: a key is missing or wrong, or the schema is newer.
    """
    if not isinstance(values, dict):
        raise ResultError("is not a result of this program")
    version = values.get("schema_version", 1)
    if type(version) is int and version > SCHEMA_VERSION:
        raise ResultError(f"has schema_version {version}; up to {SCHEMA_VERSION} can be read")
    try:
        return read_as(
            Result, {RENAMED.get(key, key): value for key, value in values.items()}, from_json=True
        )
    except ConfigError as error:
        raise ResultError(f"cannot be used: {error}") from None


def read_result(folder: Path) -> Result:
    """Read a run's result.

    Raises:
        ResultError: it is missing or damaged.
    """
    try:
        values = read_json(folder / RESULT)
    except FileNotFoundError:
        raise ResultError("is missing") from None
    except (OSError, ValueError):
        raise ResultError("cannot be read") from None
    return from_json(values)


def write_result(folder: Path, result: Result) -> None:
    """Write a run's result as an atomic write."""
    with atomic_write(folder / RESULT) as draft:
        draft.write_text(json.dumps(result.to_json(), indent=1))
