"""One record of a finished run: `result.json`, the learning curve beside it, a row of a table. No torch."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import adapter_of, read_as
from ship_trl.files.curve import CURVE, RunError, read_curve, split
from ship_trl.files.disk import atomic_write, read_json

if TYPE_CHECKING:
    import pandas as pd

RESULT = "result.json"
# Goes up when a key changes its meaning, or old files cannot be read; others are refused.
SCHEMA_VERSION = 3
# The key `untrained` in older files and kept tables.
OLD_UNTRAINED = "scratch"
# Returns and distances (m) are rounded as tables keep them: runs and their tables then give the same report.
DECIMALS = {"return": 3, "dcpa": 1}
# A source network's last path components, from its study's folder on; the ones above name a machine.
SOURCE_PATH_PARTS = 5
# Fields that say where a run lies, not what the file holds.
PLACE = ("folder", "below", "part", "changes", "rows")


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
class Episodes:
    """Training episodes or greedy evaluations in order, all [N].

    `episode` is the number of training episodes done. `dcpa` is NaN without target ships, `epsilon` NaN for
    greedy evaluations, of which the first is before training, and for algorithms without one.
    """

    episode: NDArray[np.int64]
    epsilon: NDArray[np.float64]
    returns: NDArray[np.float64]
    goal: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    dcpa: NDArray[np.float64]


@dataclass(frozen=True)
class RunRecord:
    """What a run did and reached, where it lies, and its learning curve; returns are of raw rewards.

    `config_hash` is a digest of the settings, `source_network` the source's weights. Evaluations are of an
    untrained network (`untrained`), the network before training, and the kept networks (`best`, `final`).
    `draws` are returns before training with other draws of the fresh layers. `precision` and `backend` are
    those of the conv layers in training, `steps` environment steps. `teacher` is the network that was
    distilled, with the SHA-256 of its file. Rates are shares of training episodes. `best_known_return` is the
    mean over the cases of a suite; None if their starts are perturbed. `on_source` is None where no source
    was learned, and where its episodes are drawn. `extended` are the episodes at which earlier runs ended,
    from which this one goes on.

    The file holds the fields up to there. `folder` is the run's, `below` the one that was searched, `part`
    the part of a study between them. `changes` are the settings that tell the run from others of its place,
    as words. `rows` are the curve where it does not lie in the folder.
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
    untrained: Evaluation
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
    extended: list[int] = field(default_factory=list)
    folder: Path = field(default=Path(), compare=False, repr=False)
    below: Path = field(default=Path(), compare=False, repr=False)
    part: str = field(default="", compare=False, repr=False)
    changes: str = field(default="", compare=False, repr=False)
    rows: Any = field(default=None, compare=False, repr=False)

    @property
    def place(self) -> tuple[str, str, str]:
        """Its part of the study, pair and arm."""
        return self.part, self.pair, self.arm

    @property
    def label(self) -> str:
        """The pair, with the part of the study in front if there is one."""
        return f"{self.part}/{self.pair}" if self.part else self.pair

    @property
    def name(self) -> str:
        """The arm, with the settings that tell it from others: "FT3 learn.lr=0.01"."""
        return f"{self.arm} {self.changes}".strip()

    @cached_property
    def curve(self) -> pd.DataFrame:
        """The rows of the learning curve (see `read_curve`); it is read once.

        Raises:
            RunError: it is missing or damaged.
        """
        found: pd.DataFrame = read_curve(self.folder) if self.rows is None else self.rows
        return found

    @cached_property
    def training(self) -> Episodes:
        """The training episodes of the curve."""
        return to_episodes(split(self.curve)[0])

    @cached_property
    def greedy(self) -> Episodes:
        """The greedy evaluations of the curve."""
        return to_episodes(split(self.curve)[1])

    @cached_property
    def measured(self) -> dict[str, float]:
        """Metrics that were computed before, by name."""
        return {}

    @property
    def best_known(self) -> float:
        """The best known return; NaN, and so are scores, for a run that has none."""
        return math.nan if self.best_known_return is None else self.best_known_return

    def score(self, values: Any) -> Any:
        """Scale returns to scores: 0 is random actions, 1 the best known return."""
        return (values - self.random_return) / (self.best_known - self.random_return)

    @cached_property
    def scores(self) -> NDArray[np.float64]:
        """The scores of the training episodes."""
        found: NDArray[np.float64] = self.score(self.training.returns)
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the values that the file holds."""
        left_out: Any = {0: set(PLACE)}
        found: dict[str, Any] = adapter_of(RunRecord).dump_python(
            [self], by_alias=True, exclude=left_out, warnings=False
        )[0]
        return found

    def write(self, folder: Path) -> None:
        """Write the file into a folder, atomically."""
        with atomic_write(folder / RESULT) as draft:
            draft.write_text(json.dumps(self.to_json(), indent=1))

    def to_cells(self) -> dict[str, str]:
        """Return part and values as a table's cells, without draws; "best.return" is the return of "best"."""
        values = {"part": self.part} | self.to_json()
        del values["draws"]
        if self.source_network is not None:
            values["source_network"] = "/".join(Path(self.source_network).parts[-SOURCE_PATH_PARTS:])
        row: dict[str, str] = {}
        for key, value in values.items():
            if isinstance(value, dict):
                row |= {f"{key}.{name}": as_cell(inner) for name, inner in value.items()}
            else:
                row[key] = as_cell(value)
        return row


FIELDS = tuple(one.name for one in dataclasses.fields(RunRecord) if one.name not in PLACE)


def to_episodes(rows: pd.DataFrame) -> Episodes:
    """Return the rows of a curve as arrays."""
    return Episodes(
        episode=rows["episode"].to_numpy(),
        epsilon=rows["epsilon"].to_numpy(),
        returns=rows["return"].to_numpy(),
        goal=(rows["outcome"] == "goal").to_numpy(),
        collision=(rows["outcome"] == "collision").to_numpy(),
        dcpa=rows["dcpa"].to_numpy(),
    )


def from_json(values: Any) -> RunRecord:
    """Make a record of a file's values, or raise a RunError."""
    if not isinstance(values, dict):
        raise RunError(f"{RESULT} is not a result of this program")
    version = values.get("schema_version")
    if version != SCHEMA_VERSION:
        raise RunError(f"{RESULT} has schema_version {version!r:.50}; only {SCHEMA_VERSION} can be read")
    try:
        # Where a run lies is not for its file to say.
        known = {key: value for key, value in values.items() if key in FIELDS}
        if OLD_UNTRAINED in values:
            known.setdefault("untrained", values[OLD_UNTRAINED])
        return read_as(RunRecord, known, from_json=True)
    except ConfigError as error:
        raise RunError(f"{RESULT} cannot be used: {error}") from None


def from_cells(row: dict[str, str]) -> RunRecord:
    """Make a record of a table's cells, or raise a RunError."""
    values: dict[str, Any] = {"draws": []}
    for key, cell in ((key, from_cell(cell)) for key, cell in row.items() if cell):
        outer, _, inner = key.partition(".")
        if inner:
            values.setdefault(outer, {})[inner] = cell
        else:
            values[outer] = cell
    return replace(from_json(values), part=str(values["part"]))


def as_cell(value: Any) -> str:
    """Write a value as JSON, or as plain text if that cannot be mistaken for JSON."""
    return value if isinstance(value, str) and from_cell(value) == value and value else json.dumps(value)


def from_cell(cell: str) -> Any:
    """Read a cell as JSON, or else as text."""
    try:
        return json.loads(cell)
    except (ValueError, RecursionError):
        return cell


def read_run(folder: Path, part: str = "") -> RunRecord:
    """Read the run in a folder, or raise a RunError; its curve is read when it is asked for."""
    try:
        values = read_json(folder / RESULT)
    except FileNotFoundError:
        raise RunError(f"{RESULT} is missing") from None
    except (OSError, ValueError):
        raise RunError(f"{RESULT} cannot be read") from None
    return replace(from_json(values), folder=folder, part=part)


def read_whole(folder: Path, part: str = "") -> RunRecord:
    """Read the run in a folder with its curve; see `with_curve`."""
    return with_curve(read_run(folder, part))


def with_curve(run: RunRecord) -> RunRecord:
    """Return a run with its curve, rounded to `DECIMALS`; raise a RunError if they are not whole."""
    # Python rounds the written decimal; NumPy does not always.
    columns = {name: run.curve[name].map(lambda value, n=n: round(value, n)) for name, n in DECIMALS.items()}
    draws = [round(value, DECIMALS["return"]) for value in run.draws]
    return check_run(replace(run, draws=draws, rows=run.curve.assign(**columns)))


def check_run(run: RunRecord) -> RunRecord:
    """Return a run whose curve is whole, and with scores if a best return is known; else raise a RunError.

    A whole curve has finite numbers of all training episodes in order, and evaluations from before the first
    to after the last.
    """
    if run.best_known <= run.random_return:
        raise RunError(f"{RESULT}: the best known return is not above the random one")
    try:
        Arm.of_run(run.arm)
    except ValueError as error:
        raise RunError(f"{RESULT}: {error}") from None
    (training, greedy), count = split(run.curve), run.episodes
    # The length comes first: a damaged result may claim more episodes than fit into memory.
    if len(training) != count or training["episode"].tolist() != list(range(1, count + 1)):
        raise RunError(f"{CURVE} does not have the {count} episodes of {RESULT}")
    if len(greedy) < 2 or greedy["episode"].iloc[0] != 0 or greedy["episode"].iloc[-1] != count:
        raise RunError(f"{CURVE} lacks greedy evaluations")
    numbers = [training["return"], greedy["return"]]
    # An algorithm without an epsilon has none in any episode.
    if training["epsilon"].notna().any():
        numbers.append(training["epsilon"])
    if not all(np.isfinite(column).all() for column in numbers):
        raise RunError(f"{CURVE} has a number that is not finite")
    return run
