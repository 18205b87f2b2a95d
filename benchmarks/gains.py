"""Gains of transfers over learning from scratch, from the table of `python -m benchmarks sources`."""

from __future__ import annotations

import lzma
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.files.table import Cells, rows

Floats = NDArray[np.float64]
# How many of the last greedy evaluations count as the end.
LAST = 3
COLUMNS = (
    *("target", "source", "arm", "seed", "length", "random", "best_known", "greedy", "reached"),
    "source_greedy",
)
# Not a gain: the score on the source's case at the end.
KEPT = "kept"


@dataclass(frozen=True)
class Outcome:
    """What a run reached, by the names of gains: `area` is the mean score over its evaluations.

    `jumpstart` is the score before training, `end` that of the last evaluations, `success` the share of the
    evaluations that reach the goal. Scores are 0 for random actions or worse, 1 for the best known return.
    """

    area: float
    jumpstart: float
    end: float
    success: float


KINDS = tuple(Outcome.__dataclass_fields__)


@dataclass(frozen=True)
class Gains:
    """Gains [seeds, targets, sources] of each arm by kind; NaN where source and target are one case.

    Beside them, under `KEPT`, the score on the source's case after training on the target.
    """

    cases: tuple[str, ...]
    arms: tuple[str, ...]
    values: dict[tuple[str, str], Floats]

    def of(self, arm: str, kind: str = "area") -> Floats:
        """Return the gains of an arm, [seeds, targets, sources]."""
        return self.values[arm, kind]


def read_outcome(row: Cells) -> Outcome:
    """Return what a run of the table reached; raise ValueError for a wrong cell."""
    random, known = float(row["random"]), float(row["best_known"])
    returns = np.array([float(word) for word in row["greedy"].split()])
    is_whole = LAST < len(returns) == len(row["reached"]) and bool(np.isfinite(returns).all())
    if not is_whole or not known > random:
        raise ValueError(f"the run of {row['source']} to {row['target']} has wrong numbers")
    scores = np.clip((returns - random) / (known - random), 0.0, None)
    reached = np.array([mark == "1" for mark in row["reached"]])
    return Outcome(
        area=float(scores[1:].mean()),
        jumpstart=float(scores[0]),
        end=float(scores[-LAST:].mean()),
        success=float(reached[1:].mean()),
    )


def read_runs(path: Path) -> list[Cells]:
    """Read the table of runs, also as .csv.xz.

    Raises:
        ConfigError: the file is missing or not such a table.
    """
    try:
        data = path.read_bytes()
        table = rows(lzma.decompress(data) if path.suffix == ".xz" else data, COLUMNS)
        return [cells for _, cells in table]
    except (OSError, EOFError, lzma.LZMAError) as error:
        raise ConfigError(f"runs: {path} cannot be read: {error}") from None
    except ValueError as error:
        raise ConfigError(f"runs: {path} is not a table of runs: {error}") from None


def make_gains(table: Sequence[Cells], cases: Sequence[str]) -> Gains:
    """Compute gains from the rows of a table, in the order of the cases.

    Raises:
        ConfigError: runs are missing, or hold wrong numbers.
    """
    try:
        return _make_gains(table, tuple(cases))
    except (ValueError, KeyError) as error:
        raise ConfigError(f"runs: the table is not whole: {error}") from None


def _make_gains(table: Sequence[Cells], cases: tuple[str, ...]) -> Gains:
    """Do what `make_gains` says; raise ValueError or KeyError."""
    transfers = [row for row in table if row["source"]]
    if not transfers:
        raise ValueError("it has no transfers")
    length = transfers[0]["length"]
    baselines: dict[str, list[Outcome]] = {}
    scales = {row["target"]: (float(row["random"]), float(row["best_known"])) for row in table}
    for row in table:
        if row["arm"] == SCRATCH.name and row["length"] == length:
            baselines.setdefault(row["target"], []).append(read_outcome(row))
    arms = tuple(dict.fromkeys(row["arm"] for row in transfers))
    seeds = sorted({int(row["seed"]) for row in transfers})
    shape = (len(seeds), len(cases), len(cases))
    values = {(arm, kind): np.full(shape, np.nan) for arm in arms for kind in (*KINDS, KEPT)}
    for row in transfers:
        if row["target"] not in baselines:
            raise ValueError(f"target {row['target']} has no runs from scratch")
        at = seeds.index(int(row["seed"])), cases.index(row["target"]), cases.index(row["source"])
        outcome = read_outcome(row)
        for kind in KINDS:
            scratch = np.mean([getattr(one, kind) for one in baselines[row["target"]]])
            values[row["arm"], kind][at] = getattr(outcome, kind) - scratch
        random, known = scales[row["source"]]
        left = float(row["source_greedy"].split()[-1])
        values[row["arm"], KEPT][at] = max(0.0, (left - random) / (known - random))
    missing = sum(int(np.isnan(one).sum()) for (_, kind), one in values.items() if kind == KINDS[0])
    missing -= len(arms) * len(seeds) * len(cases)
    if missing:
        raise ValueError(f"{missing} transfers are missing")
    return Gains(cases, arms, values)
