"""A finished run as the study reads it: result and learning curve, whole or named as broken."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.files.curve import CURVE, CurveError, read_curve, split
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.study.plan.jobs import PARTS

if TYPE_CHECKING:
    import pandas as pd

# Of what a study reads of a curve: returns, and distances in metres.
DECIMALS = {"return": 3, "dcpa": 1}
# What decides the digits, beside the settings.
COMPUTED = ("ship_trl", "torch", "device", "precision", "backend", "processor")
# Of runs that lie where a study has none.
NO_PART = "is no part of a study"


class BrokenRunError(Exception):
    """A run that cannot be counted; its text says why, in a few words."""


@dataclass(frozen=True)
class Episodes:
    """Episodes in order, all [N]; `dcpa` is not a number without target ships."""

    returns: NDArray[np.float64]
    goal: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    dcpa: NDArray[np.float64]


@dataclass(frozen=True)
class Training(Episodes):
    """Training episodes, with the exploration rate of each."""

    epsilon: NDArray[np.float64]


@dataclass(frozen=True)
class Greedy(Episodes):
    """Greedy evaluations, the first before training, and after how many episodes each was."""

    episode: NDArray[np.int64]


@dataclass(frozen=True)
class Record:
    """One finished run.

    `part` is the share of the study that it belongs to: its folder in it; `computed` says by what
    version, device and precision. `draws` are the greedy returns before training over draws of what is not
    copied: [D], empty where an older program did not note them.
    """

    folder: Path
    part: str
    pair: str
    source: str | None
    target: str
    arm: str
    seed: int
    profile: str
    config_hash: str
    best_known: float
    random: float
    scratch: float
    before: float
    training: Training
    greedy: Greedy
    computed: dict[str, str]
    draws: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    # Its metrics, as far as they have been asked for; another record has its own.
    measured: dict[str, float] = field(default_factory=dict, init=False, repr=False, compare=False)

    def score(self, values: Any) -> Any:
        """Scale returns to the way from random actions to the best known: 0 to 1, less if worse."""
        return (values - self.random) / (self.best_known - self.random)


def make_record(result: Result, rows: pd.DataFrame, folder: Path, part: str = "") -> Record:
    """Make a record of a run's result and its curve (`rows` as `read_curve` gives them).

    Raises:
        BrokenRunError: something is missing, or the one does not fit the other.
    """
    if result.random_return is None:
        raise BrokenRunError(f"{RESULT} has no random_return")
    if result.best_known_return <= result.random_return:
        raise BrokenRunError(f"{RESULT}: the best known return is not above the random one")
    training, greedy = split(rows)
    check_curve(training, greedy, result.episodes)
    return Record(
        folder=folder,
        part=part,
        pair=result.pair,
        source=result.source,
        target=result.target,
        arm=result.arm,
        seed=result.seed,
        profile=result.profile,
        config_hash=result.config_hash,
        best_known=result.best_known_return,
        random=result.random_return,
        scratch=result.scratch.episode_return,
        before=result.before.episode_return,
        training=Training(**episodes(training), epsilon=training["epsilon"].to_numpy()),
        greedy=Greedy(**episodes(greedy), episode=greedy["episode"].to_numpy()),
        computed={key: str(value) for key in COMPUTED if (value := getattr(result, key)) is not None},
        draws=np.array(result.draws, np.float64),
    )


def check_curve(training: pd.DataFrame, greedy: pd.DataFrame, count: int) -> None:
    """Check that a curve has training episodes 1 to `count`, and evaluations from 0 to the last.

    Raises:
        BrokenRunError: it has not.
    """
    # Its length first: a damaged result may claim more episodes than there is memory.
    if len(training) != count or training["episode"].tolist() != list(range(1, count + 1)):
        raise BrokenRunError(f"{CURVE} has not the {count} episodes of {RESULT}")
    if len(greedy) < 2 or greedy["episode"].iloc[0] != 0 or greedy["episode"].iloc[-1] != count:
        raise BrokenRunError(f"{CURVE} lacks greedy evaluations")
    numbers = training["return"], training["epsilon"], greedy["return"]
    if not all(np.isfinite(column).all() for column in numbers):
        raise BrokenRunError(f"{CURVE} holds what is no number")


def episodes(rows: pd.DataFrame) -> dict[str, NDArray[Any]]:
    """Give what training episodes and greedy evaluations have in common."""
    return {
        "returns": rows["return"].to_numpy(),
        "goal": (rows["outcome"] == "goal").to_numpy(),
        "collision": (rows["outcome"] == "collision").to_numpy(),
        "dcpa": rows["dcpa"].to_numpy(),
    }


def rounded(rows: pd.DataFrame) -> pd.DataFrame:
    """Round returns and distances of a curve to `DECIMALS`."""
    # Python's rounding is of the decimal that is written; NumPy's is not always.
    columns = {name: rows[name].map(lambda value, n=n: round(value, n)) for name, n in DECIMALS.items()}
    return rows.assign(**columns)


def rounded_draws(result: Result) -> Result:
    """Round the returns before training."""
    return replace(result, draws=[round(value, DECIMALS["return"]) for value in result.draws])


def read_run(folder: Path, part: str = "") -> Record:
    """Read a run's folder, in the precision in which tables keep it: both give the same report.

    Raises:
        BrokenRunError: a file is missing, cut short, of another program, or does not fit the other.
    """
    return make_record(*read_files(folder), folder, part)


def read_files(folder: Path) -> tuple[Result, pd.DataFrame]:
    """Read result and curve of a run's folder, rounded.

    Raises:
        BrokenRunError: a file is missing, cut short, or of another program.
    """
    try:
        return rounded_draws(read_result(folder)), rounded(read_curve(folder))
    except ResultError as error:
        raise BrokenRunError(f"{RESULT} {error}") from None
    except CurveError as error:
        raise BrokenRunError(str(error)) from None


def read_placed(folder: Path, part: str = "") -> tuple[Record, Result, pd.DataFrame]:
    """Read a run's folder, which its place in a study names: a copied folder is not another seed.

    Returns:
        The run as a record, and the result and the curve that it is made of.

    Raises:
        BrokenRunError: as `read_run`, or the run is of another place.
    """
    result, rows = read_files(folder)
    record = make_record(result, rows, folder, part)
    if folder.parts[-3:] != (record.pair, record.arm, f"seed={record.seed}"):
        raise BrokenRunError(f"{RESULT} is of another run")
    return record, result, rows


def read_runs(folder: Path, broken: list[tuple[Path, str]]) -> Iterator[tuple[Record, Result, pd.DataFrame]]:
    """Yield the runs below a study's folder; adds to `broken` those that are none, and why."""
    for path, part in find_runs(folder):
        try:
            if part not in PARTS:
                raise BrokenRunError(f"{part or folder} {NO_PART}")
            yield read_placed(path, part)
        except BrokenRunError as error:
            broken.append((path, str(error)))


def find_runs(folder: Path) -> Iterator[tuple[Path, str]]:
    """Folders of finished or unfinished runs below a study's, each with the part it belongs to."""
    for path in sorted(folder.glob("**/seed=*")):
        inside = path.relative_to(folder).parts
        if path.is_dir() and inside[0] != "case_base":
            yield path, "/".join(inside[:-3])
