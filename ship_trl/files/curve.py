"""Read and write a run's learning curve, `curve.csv`. No torch."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ship_trl.files.disk import read_file

if TYPE_CHECKING:
    import pandas as pd

CURVE = "curve.csv"
# A line is a training episode or a greedy evaluation, which has its own columns.
COLUMNS = {
    "episode": "training episodes done",
    "steps": "steps of the environment done",
    "epsilon": "share of random actions",
    "return": "sum of the rewards, undiscounted and unscaled",
    "length": "steps of the episode",
    "outcome": "goal, collision or timeout",
    "dcpa": "least distance to a target ship, m; empty without one",
    "loss": "mean loss of the updates in the episode",
    "greedy_return": "of an evaluation: mean over its greedy episodes",
    "greedy_length": "the same of their steps",
    "greedy_outcome": "their most frequent outcome",
    "greedy_dcpa": "their least distance to a target ship, m",
    "greedy_success_rate": "share that reaches the goal",
    "greedy_episodes": "how many they are",
    "source_return": "of some evaluations of a transfer: mean greedy return on the source",
}
# A line that is written, without empty cells.
Row = dict[str, Any]
# pandas takes minutes for a million columns.
MAX_HEADER_BYTES = 1000
TRAINING, GREEDY = "training", "greedy"
# The columns that both kinds of lines have.
SHARED = ("return", "outcome", "dcpa")
TYPES = {"episode": "int64", "epsilon": "float64", "return": "float64", "outcome": "str", "dcpa": "float64"}


class RunError(Exception):
    """A run that cannot be used; the text says why in a few words, beginning with its file."""


def read_curve(folder: Path) -> pd.DataFrame:
    """Read the curve in a run's folder.

    Returns:
        A row for each line of the file: `kind` (`TRAINING` or `GREEDY`), `episode` (training episodes done),
        `epsilon` (NaN for evaluations), `return` (raw, undiscounted), `outcome` (goal, collision or timeout)
        and `dcpa` (metres; NaN without target ships).

    Raises:
        RunError: the file is missing, cut short, or another program's.
    """
    import pandas as pd

    types = TYPES | {f"{GREEDY}_{name}": TYPES[name] for name in SHARED}
    try:
        data = read_file(folder / CURVE)
        if len(data.partition(b"\n")[0]) > MAX_HEADER_BYTES:
            raise ValueError
        # Without `index_col` a line with too many cells would shift its columns by one.
        with np.errstate(invalid="raise"):  # else pandas converts an infinite episode to some integer
            lines = pd.read_csv(io.BytesIO(data), usecols=list(types), dtype=types, index_col=False)
    except FileNotFoundError:
        raise RunError(f"{CURVE} is missing") from None
    except (OSError, ValueError, ArithmeticError):
        raise RunError(f"{CURVE} cannot be read") from None
    if not data.endswith(b"\n"):
        raise RunError(f"{CURVE} ends within a line")
    trained = lines["return"].notna()
    if (trained == lines[f"{GREEDY}_return"].notna()).any():
        raise RunError(f"{CURVE} has a line that is neither an episode nor an evaluation")
    rows = lines[["episode", "epsilon"]].assign(kind=np.where(trained, TRAINING, GREEDY))
    for name in SHARED:
        rows[name] = lines[name].where(trained, lines[f"{GREEDY}_{name}"])
    return rows


def split(rows: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Split rows into training episodes and greedy evaluations."""
    return rows[rows["kind"] == TRAINING], rows[rows["kind"] == GREEDY]


def write_curve(folder: Path, rows: pd.DataFrame) -> None:
    """Write rows as `read_curve` returns them; the other columns are left out."""
    trained = rows["kind"] == TRAINING
    lines = rows[["episode", "epsilon"]].assign(
        **{name: rows[name].where(trained) for name in SHARED},
        **{f"{GREEDY}_{name}": rows[name].mask(trained) for name in SHARED},
    )
    lines.to_csv(folder / CURVE, index=False, lineterminator="\n")


def moving_mean(values: ArrayLike, window: int) -> NDArray[np.float64]:
    """Return the mean of each value and up to `window - 1` values before it, [..., N]."""
    numbers = np.asarray(values, dtype=np.float64)
    sums = np.cumsum(np.pad(numbers, [(0, 0)] * (numbers.ndim - 1) + [(1, 0)]), axis=-1)
    ends = np.arange(1, numbers.shape[-1] + 1)
    starts = np.maximum(0, ends - window)
    return np.asarray((sums[..., ends] - sums[..., starts]) / (ends - starts))
