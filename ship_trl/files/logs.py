"""Read learning curves of other libraries: returns over environment steps. No torch.

Known are Stable-Baselines3's `monitor.csv`, `progress.csv` and `evaluations.npz`, scalars of TensorBoard (as
CleanRL writes them: event files, or the CSV that TensorBoard exports), our `curve.csv`, and tables with a row
for each run, step and return.
"""

from __future__ import annotations

import codecs
import io
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.files.curve import CURVE, RunError
from ship_trl.files.disk import read_file
from ship_trl.files.record import read_run
from ship_trl.files.untrusted import rows

if TYPE_CHECKING:
    import pandas as pd

# Tags of TensorBoard. CleanRL's and Stable-Baselines3's are logged over steps, ours over episodes,
# with the environment steps as a scalar of their own.
OURS, STEPS = "train/return", "train/steps"
TAGS = ("charts/episodic_return", "rollout/ep_rew_mean", OURS)
# How TensorBoard names the CSV of a tag.
OTHER_TAG = re.compile(r"-tag-(?!charts.episodic_return|rollout.ep_rew_mean)")
# Names of columns, in small letters. A table has one of each kind.
NAMES = {
    "step": ("step", "steps", "global_step", "timesteps", "total_timesteps", "time/total_timesteps", STEPS),
    "return": ("return", "episode_return", "episodic_return", "value", "reward", "r", *TAGS),
    "run": ("seed", "run", "run_id"),
}
# Columns of Stable-Baselines3's monitor: an episode's return, its length, and the seconds at its end.
MONITOR = ("r", "l")
SECONDS = "t"
# A monitor of one of the environments that a run steps together.
WORKER = re.compile(r"\d+\.monitor\.csv")
WORKERS = "*.monitor.csv"
# Of a greedy evaluation in our `curve.csv`.
SUCCESS = "greedy_success_rate"
MAX_RETURN = 1e9
EVENTS = "events.out.tfevents"
KINDS = (
    "a monitor.csv, progress.csv or evaluations.npz, a TensorBoard file, a curve.csv, "
    "or a table with columns step and return"
)

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class LearningCurve:
    """Returns [N] of one run, each at a number of environment steps [N] that never falls.

    Runs of ours also have the success rates of the greedy evaluations, [E], the returns `known` of random
    actions and of the best known plan, and after a transfer the `forgetting` of `SourceReturns`.
    """

    name: str
    steps: Numbers
    returns: Numbers
    success_rates: Numbers = field(default_factory=lambda: np.empty(0))
    known: tuple[float, float] | None = None
    forgetting: float = math.nan


def read_logs(paths: Sequence[Path], key: str) -> list[LearningCurve]:
    """Read the curves in files; `key` begins the messages.

    Event files of one folder are one run, and so are monitors of numbered workers.

    Raises:
        ConfigError: there is no such file, or it is of no known kind, or holds too little.
    """
    runs: dict[Path, list[Path]] = {}
    for path in paths:
        if not path.is_file():
            raise ConfigError(f"{key}: no file {path}; allowed: {KINDS}")
        name = EVENTS + "*" if EVENTS in path.name else WORKERS if WORKER.fullmatch(path.name) else path.name
        runs.setdefault(path.parent.resolve() / name, []).append(path)
    found = []
    for run, files in runs.items():
        name = str(files[0] if len(files) == 1 else files[0].with_name(run.name))
        if EVENTS in run.name or run.name == WORKERS:
            read = read_events if EVENTS in run.name else read_workers
            found.append(make_curve(name, read(files, key)))
        elif run.suffix == ".npz":
            found.append(read_evaluations(files[0], key))
        else:
            found += read_csv(files[0], key)
    for curve in found:
        whole = np.isfinite(curve.steps).all() and (np.abs(curve.returns) <= MAX_RETURN).all()
        if len(curve.steps) < 2 or not whole or (np.diff(curve.steps) < 0).any():
            raise ConfigError(
                f"{key}: {curve.name}: allowed: two returns or more, steps that rise, "
                f"finite numbers up to {MAX_RETURN:g}"
            )
    return found


def make_curve(name: str, points: Numbers) -> LearningCurve:
    """Make the curve of points [N, 2] of steps and returns; NaN at the beginning means no return yet."""
    begun = np.maximum.accumulate(~np.isnan(points[:, 1]))
    return LearningCurve(name, points[begun, 0], points[begun, 1])


def read_evaluations(path: Path, key: str) -> LearningCurve:
    """Read the mean returns and the success rates of Stable-Baselines3's EvalCallback."""
    try:
        packed = io.BytesIO(read_file(path))
        with np.load(packed, allow_pickle=False) as arrays:  # noqa: TID251
            # It does not compress: a compressed array may be too large for memory.
            if any(one.compress_type for one in arrays.zip.infolist()):
                raise ValueError("it is compressed")
            steps, returns = (np.asarray(arrays[name], np.float64) for name in ("timesteps", "results"))
            rates = np.asarray(arrays["successes"], np.float64).mean(1) if "successes" in arrays else []
        points = np.column_stack((steps, returns.mean(1)))
    except Exception as error:  # numpy and zipfile raise many kinds
        raise ConfigError(f"{key}: {path} cannot be read ({error}); allowed: {KINDS}") from None
    return replace(make_curve(str(path), points), success_rates=np.asarray(rates, np.float64))


def read_cells(path: Path, key: str) -> tuple[str, pd.DataFrame]:
    """Read a CSV file: its first line if it begins with #, as a monitor's does, and its cells as text."""
    import pandas as pd

    try:
        data = read_file(path).removeprefix(codecs.BOM_UTF8)
        comment = data.partition(b"\n")[0].decode() if data.startswith(b"#") else ""
        table = pd.DataFrame([cells for _, cells in rows(data, ())])
        # These end with a line's end; a last line without one may have lost digits.
        if (comment or path.name in (CURVE, "progress.csv")) and not data.endswith(b"\n"):
            raise ValueError(f"line {len(data.splitlines())} is cut")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{key}: {path} cannot be read ({error}); allowed: {KINDS}") from None
    return comment, table


def to_numbers(path: Path, cells: pd.DataFrame, columns: Sequence[str], key: str) -> Numbers:
    """Return the numbers in columns of a table, [rows, columns]."""
    try:
        return cells.reindex(columns=list(columns)).fillna("").to_numpy().astype(np.float64)
    except ValueError as error:
        raise ConfigError(f"{key}: {path} has no numbers {' and '.join(columns)}: {error}") from None


def read_workers(paths: Sequence[Path], key: str) -> Numbers:
    """Read the monitors of a run's workers: episodes by their ends, over steps of all workers.

    Raises:
        ConfigError: a worker is left out, or they did not work at the same time.
    """
    folder, names = paths[0].parent, {path.name for path in paths}
    if left_out := sorted({one.name for one in folder.iterdir() if WORKER.fullmatch(one.name)} - names):
        allowed = f"all workers of a run, {folder / WORKERS}"
        raise ConfigError(f"{key}: {folder / left_out[0]} is left out; allowed: {allowed}")
    parts, starts = [np.empty((0, 3))], []
    for path in paths:
        comment, cells = read_cells(path, key)
        part = to_numbers(path, cells, (*MONITOR, SECONDS), key)
        if len(paths) == 1:
            # A run that was continued counts its seconds anew.
            return sum_lengths(part)
        try:
            start = float(json.loads(comment[1:])["t_start"])
            if (np.diff(part[:, 2]) < 0).any():
                raise ValueError
        except (KeyError, TypeError, ValueError):
            allowed = f"workers with a t_start in the first line, and a {SECONDS} that rises"
            raise ConfigError(f"{key}: {path}: allowed: {allowed}") from None
        if len(part):
            parts.append(part + np.array([0, 0, start]))
            starts.append(start)
    if starts and max(starts) > min(part[-1, 2] for part in parts[1:]):
        told = f"{folder / WORKERS} are not workers of one run, as one began after another's end"
        raise ConfigError(f"{key}: {told}; allowed: a folder for each run")
    episodes = np.concatenate(parts)
    return sum_lengths(episodes[np.argsort(episodes[:, 2], kind="stable")])


def sum_lengths(episodes: Numbers) -> Numbers:
    """Return the steps after each episode, and its return, [N, 2], of episodes as `MONITOR` has them."""
    return np.column_stack((np.cumsum(episodes[:, 1]), episodes[:, 0]))


def read_csv(path: Path, key: str) -> list[LearningCurve]:
    """Read a CSV file; without a column of runs it is one run."""
    comment, cells = read_cells(path, key)
    names = [str(name) for name in cells]
    columns = {kind: [one for one in names if one.strip().lower() in words] for kind, words in NAMES.items()}
    if set(MONITOR) <= set(names) and (comment or not columns["step"]):
        return [make_curve(str(path), sum_lengths(to_numbers(path, cells, MONITOR, key)))]
    for kind, fitting in columns.items():
        if len(fitting) > 1:
            told = f"{' and '.join(fitting)}, of which each may be the {kind}"
            raise ConfigError(f"{key}: {path} has {told}; allowed: one of them")
    if not columns["step"] or not columns["return"]:
        raise ConfigError(f"{key}: {path} has {', '.join(names) or 'no rows'}; allowed: {KINDS}")
    step, reward = columns["step"][0], columns["return"][0]
    over_episodes = reward.strip().lower() == OURS and step.strip().lower() != STEPS
    if over_episodes or re.search("tag-(train|greedy).return", path.name):
        raise ConfigError(f"{key}: {path} counts episodes; allowed: the run's {CURVE}")
    if OTHER_TAG.search(path.name):
        raise ConfigError(f"{key}: {path} has another scalar than {TAGS[0]} or {TAGS[1]}; allowed: {KINDS}")
    # Blank are the evaluations of a `curve.csv`, and what a logger wrote at other steps.
    filled = cells[cells[reward] != ""]
    by_run = filled.groupby(columns["run"], sort=False) if columns["run"] else [(("",), filled)]
    curves = [
        make_curve(f"{path} {run}".strip(), to_numbers(path, own, (step, reward), key))
        for (run,), own in by_run
    ]
    return [add_own(curves[0], path, cells, key)] if path.name == CURVE and len(curves) == 1 else curves


def add_own(curve: LearningCurve, path: Path, cells: pd.DataFrame, key: str) -> LearningCurve:
    """Add what our `curve.csv`, and the result beside it if there is one, say besides returns."""
    if SUCCESS in cells:
        rates = to_numbers(path, cells[cells[SUCCESS] != ""], (SUCCESS,), key)[:, 0]
        curve = replace(curve, success_rates=rates)
    try:
        result = read_run(path.parent)
    except RunError:
        return curve
    low, high = result.random_return, result.best_known_return
    return replace(
        curve,
        known=(low, high) if high is not None and high > low else None,
        forgetting=math.nan if result.on_source is None else result.on_source.forgetting,
    )


def read_events(paths: Sequence[Path], key: str) -> Numbers:
    """Read the returns in the event files of a run: a later file replaces what it overlaps.

    Raises:
        ConfigError: no file has returns over environment steps, or two were written at the same time.
    """
    parts = [part for path in paths if (part := read_scalars(path, key)) is not None]
    if not parts:
        raise ConfigError(f"{key}: {paths[0]} has none of the scalars {', '.join(TAGS)}")
    points, *later = sorted(parts, key=lambda part: float(part[0, 2]))
    for part in later:
        if part[0, 2] < points[-1, 2]:
            told = f"{paths[0].parent} holds event files of several runs at the same time"
            raise ConfigError(f"{key}: {told}; allowed: a folder for each run")
        points = np.concatenate((points[points[:, 0] < part[0, 0]], part))
    return points[:, :2]


def read_scalars(path: Path, key: str) -> Numbers | None:
    """Return steps, returns and times (s), [N, 3], in an event file; None if it has no returns."""
    try:
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
    except ImportError:
        raise ConfigError(f"{key}: {missing_extra('tensorboard', 'tensorboard')}") from None
    log: Any = EventAccumulator(str(path), {"scalars": 0})
    log.Reload()
    found = [tag for tag in TAGS if tag in (tags := log.Tags()["scalars"])]
    if len(found) > 1:
        raise ConfigError(f"{key}: {path} has {' and '.join(found)}; allowed: one of them")
    if not found:
        return None
    scalars, steps = log.Scalars(found[0]), {}
    if found[0] == OURS:
        steps = {one.step: one.value for one in log.Scalars(STEPS)} if STEPS in tags else {}
        if any(one.step not in steps for one in scalars):
            told = f"counts {OURS} over something else than environment steps"
            raise ConfigError(f"{key}: {path} {told}; allowed: the run's {CURVE}")
    points = [(steps.get(one.step, one.step), one.value, one.wall_time) for one in scalars]
    return np.array(points, np.float64)
