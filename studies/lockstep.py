"""Studies whose runs learn in lockstep: what a run is, the table of all, and making those that it lacks."""

from __future__ import annotations

import lzma
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config
from ship_trl.files.disk import atomic_write
from ship_trl.grid.compose import compose_config
from ship_trl.run.plan import Run, make_run
from ship_trl.run.process import configure_process

# Greedy evaluations in a run, and how many of the last ones count as the end.
EVALUATIONS, LAST = 15, 3
# Runs that a process trains at once.
CPU_RUNS, GPU_RUNS = 64, 320
# What a run reached, by its greedy evaluations: see `add_outcomes`.
OUTCOMES = ("area", "jumpstart", "end", "success")
Row = dict[str, Any]


class Task(NamedTuple):
    """A run of `length` environment steps; without a source it learns from scratch.

    `learner` changes settings, as on a command line. The source has the seed `source_seed`, or that of the
    run. The network of a run that `is_source` is kept.
    """

    target: str
    source: str
    arm: str
    seed: int
    length: int
    learner: str = ""
    source_seed: int | None = None
    is_source: bool = False

    @property
    def key(self) -> tuple[str, ...]:
        """What tells the run from others in the table."""
        return tuple(map(str, self[: len(KEY)]))

    def plan(self, overrides: Sequence[str], folder: Path) -> Run:
        """Plan the run with the overrides that all share; its source lies in the folder."""
        arm, seed = Arm.parse(self.arm), self.seed if self.source_seed is None else self.source_seed
        config = replace(
            shared_config((*overrides, *self.learner.split())),
            target=self.target,
            source=self.source or None,
            source_file=str(weights_path(folder, self.source, seed)) if arm.has_trained_source else None,
            seed=self.seed,
        )
        return make_run(config.with_arm(arm))


KEY = Task._fields[:6]
# Trains runs of one length and one learner; returns a row of each.
Train = Callable[..., list[Row]]


@cache
def shared_config(overrides: tuple[str, ...]) -> Config:
    """Compose the configuration that all runs share, once a process."""
    # No run writes there, but its plan looks whether the folder is free.
    output = f"output={tempfile.gettempdir()}/ship_trl_studies"
    words = ["profile=quick", "target=1", "method=scratch", "learn.jumpstart_draws=0", output, *overrides]
    return compose_config(*words)


def weights_path(folder: Path, case: str, seed: int) -> Path:
    """Return where a source's weights lie."""
    return folder / f"{case}-{seed}.safetensors"


def paths_to_keep(tasks: Iterable[Task], folder: Path) -> list[Path | None]:
    """Return where the network of each run is kept, None for those that are no source."""
    return [weights_path(folder, task.target, task.seed) if task.is_source else None for task in tasks]


def make_row(
    task: Task,
    greedy: Iterable[float],
    reached: Iterable[float],
    on_source: Iterable[float],
    seconds: float,
) -> Row:
    """Make the row of a finished run.

    `greedy` are greedy returns at equal distances, the first before training; `reached` says where the goal
    was reached; `on_source` are returns on the source's case. `seconds` is processor time.
    """
    random, known = bounds(task.target)
    return dict(zip(KEY[:-1], task, strict=False)) | {
        "random": round(random, 2),
        "best_known": round(known, 2),
        "greedy": join(greedy),
        "reached": "".join(str(int(one)) for one in reached),
        "source_greedy": join(on_source),
        "seconds": round(seconds, 2),
    }


@cache
def bounds(case: str) -> tuple[float, float]:
    """Return the mean return of random actions in a case, and the best known return."""
    from ship_trl.policies.reference import score_bounds
    from ship_trl.sim.cases import load_case, load_world

    world = load_world()
    return score_bounds(load_case(case, world), world)


def join(values: Iterable[float]) -> str:
    """Write numbers with spaces between them."""
    return " ".join(f"{value:.2f}" for value in values)


def read_table(path: Path) -> tuple[pd.DataFrame, list[tuple[str, ...]]]:
    """Read a table of runs, and what tells each from others; lists of numbers stay text, as names do."""
    types = dict.fromkeys((*KEY, "greedy", "reached", "source_greedy"), str)
    runs = pd.read_csv(path, dtype=types, keep_default_na=False)
    keys = runs.reindex(columns=KEY, fill_value="").itertuples(index=False, name=None)
    return runs.astype({name: int for name in ("seed", "length") if name in runs}), list(keys)


def read_runs(folder: Path, wanted: Iterable[Task], first: str) -> pd.DataFrame:
    """Read the table of runs beside a folder, just made or the one that was kept, and what each run reached.

    Raises:
        ConfigError: the file is missing or no such table; a run of `wanted`, which the command `first` makes,
            is missing, or one is there twice.
    """
    made, kept = folder.with_suffix(".csv"), folder.with_suffix(".csv.xz")
    path = made if made.is_file() else kept
    try:
        runs, keys = read_table(path)
        add_outcomes(runs)
    except FileNotFoundError:
        raise ConfigError(f"runs: no table {made}; allowed: after {first}") from None
    except (ValueError, KeyError, AttributeError, EOFError, lzma.LZMAError) as error:
        raise ConfigError(f"runs: {path} is not a table of runs: {error}") from None
    if len(set(keys)) < len(keys):
        raise ConfigError(f"runs: {path} has a run twice; allowed: once")
    if missing := {task.key for task in wanted} - set(keys):
        raise ConfigError(f"runs: {len(missing)} runs are missing in {path}; allowed: after {first}")
    return runs


def add_outcomes(runs: pd.DataFrame) -> None:
    """Add to each run what it reached; raise ValueError for a wrong number.

    `area` is the mean score over its evaluations, `jumpstart` the score before training, `end` that of the
    last evaluations, `success` the share of the evaluations that reach the goal. Scores are 0 for random
    actions or worse, 1 for the best known return.
    """
    returns = np.array([[float(word) for word in words.split()] for words in runs["greedy"]])
    reached = np.array([[mark == "1" for mark in marks] for marks in runs["reached"]])
    random, known = (runs[name].to_numpy(np.float64)[:, None] for name in ("random", "best_known"))
    is_whole = returns.ndim == 2 and returns.shape == reached.shape and returns.shape[1] > LAST
    if not is_whole or not np.isfinite(returns).all() or not (known > random).all():
        raise ValueError("a run has wrong numbers")
    scores = np.clip((returns - random) / (known - random), 0.0, None)
    runs["area"] = scores[:, 1:].mean(1)
    runs["jumpstart"] = scores[:, 0]
    runs["end"] = scores[:, -LAST:].mean(1)
    runs["success"] = reached[:, 1:].mean(1)


def make_missing(tasks: list[Task], folder: Path, train: Train, processes: int, device: str) -> None:
    """Make the runs that are not in the table beside the folder, sources first; a stopped study goes on."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder.with_suffix(".csv")
    runs, done = read_table(table) if table.exists() else (pd.DataFrame(), [])
    known = set(done)
    tasks = [task for task in tasks if task.key not in known]
    processes, at_once = (1, GPU_RUNS) if device == "cuda" else (processes, CPU_RUNS)
    work, count = partial(train, folder=folder, device=device), 0
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=configure_process) as pool:
        for stage in (True, False):
            jobs = []
            for learner in dict.fromkeys(task.learner for task in tasks):
                own = [task for task in tasks if (task.is_source, task.learner) == (stage, learner)]
                jobs += [pool.submit(work, own[k : k + at_once]) for k in range(0, len(own), at_once)]
            try:
                for job in as_completed(jobs):
                    made = job.result()
                    runs, count = pd.concat([runs, pd.DataFrame(made)]), count + len(made)
                    with atomic_write(table) as draft:
                        runs.to_csv(draft, index=False, lineterminator="\n")
                    seconds = sum(row["seconds"] for row in made)
                    where = f"to {made[-1]['target']}, {seconds:.1f} s of a core"
                    sys.stdout.write(f"{count} of {len(tasks)} runs: {where}\n")
                    sys.stdout.flush()
            except BaseException:
                # Else the pool would make all other runs first, and lose them.
                pool.shutdown(cancel_futures=True)
                raise
    sys.stdout.write(f"{table}\n")
