"""A finished run: its result and learning curve, checked against each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.arm import Arm
from ship_trl.config.errors import print_error
from ship_trl.files.curve import CURVE, CurveError, read_curve, split
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.study.plan import PARTS, Place

if TYPE_CHECKING:
    import pandas as pd

    # A record with the curve that it is made of.
    Run = tuple["Record", pd.DataFrame]

# Returns and distances (m) are rounded as tables keep them: runs and their tables then give the same report.
DECIMALS = {"return": 3, "dcpa": 1}
# Fields of a result, beside the settings, that may change digits.
COMPUTED = ("ship_trl", "torch", "device", "precision", "backend", "processor")
# End of the message for runs outside a study's parts.
NO_PART = "is no part of a study"


class BrokenRunError(Exception):
    """A run that cannot be used; the text says why in a few words."""


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
class Record:
    """A finished run with the best known return of its target; `measured` caches metrics."""

    folder: Path
    part: str
    result: Result
    arm: Arm
    best_known: float
    training: Episodes
    greedy: Episodes
    measured: dict[str, float] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def place(self) -> Place:
        """Its part of the study, pair and arm."""
        return self.part, self.result.pair, self.arm.name

    @property
    def scores(self) -> NDArray[np.float64]:
        """The scores of the training episodes."""
        found: NDArray[np.float64] = self.score(self.training.returns)
        return found

    def score(self, values: Any) -> Any:
        """Scale returns to scores: 0 is random actions, 1 the best known return."""
        random = self.result.random_return
        return (values - random) / (self.best_known - random)


def make_record(result: Result, rows: pd.DataFrame, folder: Path, part: str = "") -> Record:
    """Make a record of a result and its curve, or raise a BrokenRunError if they do not fit."""
    if result.best_known_return is None:
        raise BrokenRunError(f"{RESULT}: has no best known return, as its starts are perturbed")
    if result.best_known_return <= result.random_return:
        raise BrokenRunError(f"{RESULT}: the best known return is not above the random one")
    try:
        arm = Arm.parse(result.arm)
    except ValueError as error:
        raise BrokenRunError(f"{RESULT}: {error}") from None
    training, greedy = split(rows)
    check_curve(training, greedy, result.episodes)
    episodes = to_episodes(training), to_episodes(greedy)
    return Record(folder, part, result, arm, result.best_known_return, *episodes)


def check_curve(training: pd.DataFrame, greedy: pd.DataFrame, count: int) -> None:
    """Check that a curve has finite numbers of episodes 1 to `count`, and evaluations from 0 to `count`."""
    # The length comes first: a damaged result may claim more episodes than fit into memory.
    if len(training) != count or training["episode"].tolist() != list(range(1, count + 1)):
        raise BrokenRunError(f"{CURVE} does not have the {count} episodes of {RESULT}")
    if len(greedy) < 2 or greedy["episode"].iloc[0] != 0 or greedy["episode"].iloc[-1] != count:
        raise BrokenRunError(f"{CURVE} lacks greedy evaluations")
    numbers = [training["return"], greedy["return"]]
    # An algorithm without an epsilon has none in any episode.
    if training["epsilon"].notna().any():
        numbers.append(training["epsilon"])
    if not all(np.isfinite(column).all() for column in numbers):
        raise BrokenRunError(f"{CURVE} has a number that is not finite")


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


def read_run(folder: Path, part: str = "") -> Run:
    """Read a run's folder and round to `DECIMALS`; raise a BrokenRunError if a file is not whole."""
    try:
        result, rows = read_result(folder), read_curve(folder)
    except ResultError as error:
        raise BrokenRunError(f"{RESULT} {error}") from None
    except CurveError as error:
        raise BrokenRunError(str(error)) from None
    # Python rounds the written decimal; NumPy does not always.
    columns = {name: rows[name].map(lambda value, n=n: round(value, n)) for name, n in DECIMALS.items()}
    result = replace(result, draws=[round(value, DECIMALS["return"]) for value in result.draws])
    rows = rows.assign(**columns)
    return make_record(result, rows, folder, part), rows


def read_groups(groups: Mapping[str, Sequence[Path]]) -> Iterator[tuple[str, Record]]:
    """Yield the runs in the folders of each group, with its name; name those that are not whole on stderr."""
    for name, folders in groups.items():
        for folder in folders:
            try:
                yield name, read_run(folder)[0]
            except BrokenRunError as error:
                print_error(f"{folder}: {error}; left out")


def read_placed(folder: Path, part: str = "") -> Run:
    """Read a run's folder, whose path must name the run: a copied folder is no further seed."""
    run = read_run(folder, part)
    record = run[0]
    if folder.parts[-3:] != (*record.place[1:], f"seed={record.result.seed}"):
        raise BrokenRunError(f"{RESULT} is of another run")
    return run


def read_runs(folder: Path, broken: list[tuple[Path, str]]) -> Iterator[Run]:
    """Yield the whole runs below a study's folder; add the others to `broken`, with the reason."""
    for path in sorted(folder.glob("**/seed=*")):
        inside = path.relative_to(folder).parts
        if not path.is_dir() or inside[0] == "case_base":
            continue
        part = "/".join(inside[:-3])
        try:
            if part not in PARTS:
                raise BrokenRunError(f"{part or folder} {NO_PART}")
            yield read_placed(path, part)
        except BrokenRunError as error:
            broken.append((path, str(error)))
