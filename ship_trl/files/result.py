"""A run's result, and the only reader and writer of `result.json`. No torch."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.files.disk import atomic_write, read_json

RESULT = "result.json"
# Goes up when a key is renamed, changes its meaning, or is added without a default; others are refused.
SCHEMA_VERSION = 3


class ResultError(Exception):
    """A result that is missing or damaged; the text follows the file's name."""


@dataclass(frozen=True)
class Evaluation:
    """The greedy episodes of an evaluation; of a single case there is one.

    `episode_return` is the mean undiscounted sum of raw rewards (`return` in the file); `outcome` the most
    frequent one, goal, collision or timeout; `length` the mean in steps; `dcpa` the least distance to a
    target ship in metres, None without target ships; `episode` counts the training episodes before;
    `success_rate` is the share of the `episodes` that end at the goal.
    """

    episode_return: Annotated[float, Field(alias="return")]
    outcome: str
    length: int
    dcpa: float | None
    episode: int
    success_rate: float = math.nan
    episodes: int = 1

    def __post_init__(self) -> None:
        if math.isnan(self.success_rate):
            # A file written before there were suites.
            object.__setattr__(self, "success_rate", float(self.outcome == "goal"))


@dataclass(frozen=True)
class SourceReturns:
    """Mean greedy returns of a transfer on its source, each case once.

    `network` is of the source network itself. `before`, `best` and `final` are of the network in training:
    before training, at its best evaluation on the target, and at the end. `random` is of random actions;
    `best_known` is None where no plan is known.
    """

    network: float
    before: float
    best: float
    final: float
    random: float
    best_known: float | None

    @property
    def forgetting(self) -> float:
        """Score of the source network less that at the end: 0 is random actions, 1 the best known return.

        NaN where no plan is known, or none above random actions.
        """
        if self.best_known is None or self.best_known <= self.random:
            return math.nan
        return (self.network - self.final) / (self.best_known - self.random)


@dataclass(frozen=True)
class Result:
    """What a run did and reached; returns are of raw rewards.

    `config_hash` is a digest of the settings, `source_network` the source's weights. Evaluations are of an
    untrained network (`scratch`), the network before training, and the kept networks (`best`, `final`).
    `draws` are returns before training with other draws of the fresh layers. `precision` and `backend` are
    those of the conv layers in training, `steps` environment steps. `teacher` is the network that was
    distilled, with the SHA-256 of its file. Rates are shares of training episodes. `best_known_return` is the
    mean over the cases of a suite; None if their starts are perturbed. `on_source` is None where no source
    was learned, and where its episodes are drawn.
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
    best_known_return: float | None
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
    random_return: float
    draws: list[float]
    precision: str
    backend: str
    algorithm_version: int
    schema_version: int
    teacher: str | None = None
    on_source: SourceReturns | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the values that the file holds."""
        values = dataclasses.asdict(self)
        for key, value in values.items():
            if isinstance(getattr(self, key), Evaluation):
                values[key] = {"return": value.pop("episode_return")} | value
        return values


def from_json(values: Any) -> Result:
    """Make a result from a file's values, or raise a ResultError."""
    if not isinstance(values, dict):
        raise ResultError("is not a result of this program")
    version = values.get("schema_version")
    if version != SCHEMA_VERSION:
        raise ResultError(f"has schema_version {version!r:.50}; only {SCHEMA_VERSION} can be read")
    try:
        return read_as(Result, values, from_json=True)
    except ConfigError as error:
        raise ResultError(f"cannot be used: {error}") from None


def read_result(folder: Path) -> Result:
    """Read a run's result, or raise a ResultError."""
    try:
        values = read_json(folder / RESULT)
    except FileNotFoundError:
        raise ResultError("is missing") from None
    except (OSError, ValueError):
        raise ResultError("cannot be read") from None
    return from_json(values)


def write_result(folder: Path, result: Result) -> None:
    """Write a run's result atomically."""
    with atomic_write(folder / RESULT) as draft:
        draft.write_text(json.dumps(result.to_json(), indent=1))
