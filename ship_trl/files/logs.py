"""Read learning curves of other libraries: returns over environment steps. No torch.

Known are Stable-Baselines3's `monitor.csv`, scalars of TensorBoard (as CleanRL writes them: an event file, or
the CSV that TensorBoard exports), our `curve.csv`, and tables with a row for each run, step and return.
"""

from __future__ import annotations

import codecs
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.files.curve import CURVE
from ship_trl.files.disk import read_file
from ship_trl.files.result import ResultError, read_result
from ship_trl.files.table import rows

# Names of columns, in small letters; the first that a table has counts.
STEPS = ("step", "steps", "global_step", "timesteps", "total_timesteps")
RETURNS = ("return", "episode_return", "episodic_return", "value", "reward", "r")
RUNS = ("seed", "run", "run_id")
# Columns of Stable-Baselines3's monitor: an episode's return and length.
MONITOR = ("r", "l")
# Tags of TensorBoard: CleanRL's, Stable-Baselines3's and ours.
TAGS = ("charts/episodic_return", "rollout/ep_rew_mean", "train/return")
# Of a greedy evaluation in our `curve.csv`.
SUCCESS = "greedy_success_rate"
MAX_RETURN = 1e9
EVENTS = "events.out.tfevents"
KINDS = "a monitor.csv, a TensorBoard file, a curve.csv, or a table with columns step and return"


@dataclass(frozen=True)
class LearningCurve:
    """Returns [N] of one run, each at a number of environment steps [N] that never falls.

    Runs of ours also have the success rates of the greedy evaluations, [E], and after a transfer the
    `forgetting` of `SourceReturns`.
    """

    name: str
    steps: NDArray[np.float64]
    returns: NDArray[np.float64]
    success_rates: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    forgetting: float = math.nan


def read_logs(path: Path, key: str) -> list[LearningCurve]:
    """Read the curves in a file; `key` begins the messages.

    Raises:
        ConfigError: there is no such file, or it is of no known kind, or holds too little.
    """
    if not path.is_file():
        raise ConfigError(f"{key}: no file {path}; allowed: {KINDS}")
    found = read_events(path, key) if EVENTS in path.name else read_csv(path, key)
    for curve in found:
        whole = np.isfinite(curve.steps).all() and (np.abs(curve.returns) <= MAX_RETURN).all()
        if len(curve.steps) < 2 or not whole or (np.diff(curve.steps) < 0).any():
            raise ConfigError(
                f"{key}: {curve.name}: allowed: two returns or more, steps that rise, "
                f"finite numbers up to {MAX_RETURN:g}"
            )
    return found


def read_csv(path: Path, key: str) -> list[LearningCurve]:
    """Read a CSV file; without a column of runs it is one run."""
    try:
        data = read_file(path).removeprefix(codecs.BOM_UTF8)
        # Stable-Baselines3's monitor begins with a line of JSON behind a #.
        start = data.partition(b"\n")[2] if data.startswith(b"#") else data
        table = rows(start, ())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{key}: {path} cannot be read ({error}); allowed: {KINDS}") from None
    columns = {str(name).strip().lower(): str(name) for name in (table[0] if table else {})}
    names = {
        kind: next((one for one in words if one in columns), None)
        for kind, words in (("step", STEPS), ("return", RETURNS), ("run", RUNS))
    }
    is_monitor = set(MONITOR) <= set(columns)
    if names["return"] is None or (names["step"] is None and not is_monitor):
        got = ", ".join(columns) or "no rows"
        raise ConfigError(f"{key}: {path} has {got}; allowed: {KINDS}")
    runs: dict[str, list[tuple[float, float]]] = {}
    step_column = columns["l" if is_monitor else str(names["step"])]
    return_column = columns[str(names["return"])]
    for row in table:
        if not row[return_column]:  # an evaluation between the episodes of a curve.csv
            continue
        try:
            pair = float(row[step_column]), float(row[return_column])
        except (TypeError, ValueError):
            raise ConfigError(f"{key}: {path} has a row without numbers: {list(row.values())}") from None
        runs.setdefault(str(row[columns[names["run"]]]) if names["run"] else "", []).append(pair)
    curves = [make_curve(path, run, np.array(pairs), is_monitor) for run, pairs in runs.items()]
    return [add_own(curves[0], path, table, key)] if path.name == CURVE and len(curves) == 1 else curves


def add_own(curve: LearningCurve, path: Path, table: Sequence[Mapping[str, str]], key: str) -> LearningCurve:
    """Add what our `curve.csv`, and the result beside it if there is one, say besides returns."""
    try:
        rates = np.array([float(row[SUCCESS]) for row in table if row.get(SUCCESS)])
    except ValueError:
        raise ConfigError(f"{key}: {path} has a {SUCCESS} that is no number") from None
    source = None
    with suppress(ResultError):
        source = read_result(path.parent).on_source
    return replace(curve, success_rates=rates, forgetting=math.nan if source is None else source.forgetting)


def make_curve(path: Path, run: str, pairs: NDArray[np.float64], are_lengths: bool) -> LearningCurve:
    """Make the curve of pairs [N, 2] of steps, or of lengths of episodes, and returns."""
    steps = np.cumsum(pairs[:, 0]) if are_lengths else pairs[:, 0]
    return LearningCurve(f"{path} {run}".strip(), steps, pairs[:, 1])


def read_events(path: Path, key: str) -> list[LearningCurve]:
    """Read the returns in a TensorBoard event file."""
    try:
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
    except ImportError:
        raise ConfigError(f"{key}: {missing_extra('tensorboard', 'tensorboard')}") from None
    log: Any = EventAccumulator(str(path), {"scalars": 0})
    log.Reload()
    tags = [tag for tag in TAGS if tag in log.Tags()["scalars"]]
    if not tags:
        raise ConfigError(f"{key}: {path} has none of the scalars {', '.join(TAGS)}")
    points = [(one.step, one.value) for one in log.Scalars(tags[0])]
    return [make_curve(path, "", np.array(points, np.float64), are_lengths=False)]
