"""Finished runs as the study reads them: result and learning curve, whole or named as broken."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.result import RESULT, ResultError, read_result

CURVE = "curve.csv"
# What decides the digits, beside the settings.
COMPUTED = ("ship_trl", "torch", "device", "precision", "processor")


class BrokenRunError(Exception):
    """A run that cannot be counted; its text says why, in a few words."""


@dataclass(frozen=True)
class Training:
    """Training episodes, in order: all [E]. `dcpa` is not a number without target ships."""

    returns: NDArray[np.float64]
    goal: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    dcpa: NDArray[np.float64]
    epsilon: NDArray[np.float64]


@dataclass(frozen=True)
class Greedy:
    """Greedy evaluations, in order, the first before training: all [G]."""

    episode: NDArray[np.int64]
    returns: NDArray[np.float64]
    goal: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    dcpa: NDArray[np.float64]


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


def read_run(folder: Path, part: str = "") -> Record:
    """Read a run's folder.

    Raises:
        BrokenRunError: a file is missing, cut short, of another program, or does not fit the other.
    """
    try:
        result = read_result(folder)
    except ResultError as error:
        raise BrokenRunError(f"{RESULT} {error}") from None
    if result.random_return is None:
        raise BrokenRunError(f"{RESULT} has no random_return")
    if result.best_known_return <= result.random_return:
        raise BrokenRunError(f"{RESULT}: the best known return is not above the random one")
    training, greedy = read_curve(folder / CURVE, result.episodes)
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
        training=training,
        greedy=greedy,
        computed={key: str(value) for key in COMPUTED if (value := getattr(result, key)) is not None},
        draws=np.array(result.draws, np.float64),
    )


def read_placed(folder: Path, part: str = "") -> Record:
    """Read a run's folder, which its place in a study names: a copied folder is not another seed.

    Raises:
        BrokenRunError: as `read_run`, or the run is of another place.
    """
    record = read_run(folder, part)
    if folder.parts[-3:] != (record.pair, record.arm, f"seed={record.seed}"):
        raise BrokenRunError(f"{RESULT} is of another run")
    return record


def read_curve(path: Path, episodes: int) -> tuple[Training, Greedy]:
    """`curve.csv`: episodes 1 to `episodes`, and greedy evaluations from 0 to the last."""
    try:
        text = path.read_text()
        lines = list(csv.DictReader(text.splitlines()))
        trained = [line for line in lines if line["return"]]
        judged = [line for line in lines if line["greedy_return"]]
        numbers = [int(line["episode"]) for line in trained]
        training = Training(
            column(trained, "return"),
            words(trained, "outcome", "goal"),
            words(trained, "outcome", "collision"),
            column(trained, "dcpa"),
            column(trained, "epsilon"),
        )
        greedy = Greedy(
            np.array([int(line["episode"]) for line in judged]),
            column(judged, "greedy_return"),
            words(judged, "greedy_outcome", "goal"),
            words(judged, "greedy_outcome", "collision"),
            column(judged, "greedy_dcpa"),
        )
    except FileNotFoundError:
        raise BrokenRunError(f"{path.name} is missing") from None
    except (OSError, ValueError, KeyError, TypeError, csv.Error):
        raise BrokenRunError(f"{path.name} cannot be read") from None
    if text and not text.endswith("\n"):
        raise BrokenRunError(f"{path.name} ends within a line")
    if numbers != list(range(1, episodes + 1)):
        raise BrokenRunError(f"{path.name} has not the {episodes} episodes of {RESULT}")
    if len(judged) < 2 or greedy.episode[0] != 0 or greedy.episode[-1] != episodes:
        raise BrokenRunError(f"{path.name} lacks greedy evaluations")
    if not all(np.isfinite(values).all() for values in (training.returns, training.epsilon, greedy.returns)):
        raise BrokenRunError(f"{path.name} holds what is no number")
    return training, greedy


def column(lines: list[dict[str, str]], key: str) -> NDArray[np.float64]:
    """Numbers of a column; an empty field is not a number."""
    return np.array([float(line[key] or "nan") for line in lines])


def words(lines: list[dict[str, str]], key: str, word: str) -> NDArray[np.bool_]:
    """Where a column has this word."""
    return np.array([line[key] == word for line in lines], np.bool_)


def find_runs(folder: Path) -> Iterator[tuple[Path, str]]:
    """Folders of finished or unfinished runs below a study's, each with the part it belongs to."""
    for path in sorted(folder.glob("**/seed=*")):
        inside = path.relative_to(folder).parts
        if path.is_dir() and inside[0] != "case_base":
            yield path, "/".join(inside[:-3])
