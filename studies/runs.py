"""Runs that are trained many at once: what one is, the table of all, and making those that it lacks."""

from __future__ import annotations

import lzma
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ship_trl.cli.parser import Parser, add_number
from ship_trl.config.arm import Arm
from ship_trl.config.bounds import Positive
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config
from ship_trl.files.disk import atomic_write

if TYPE_CHECKING:
    from ship_trl.run.plan import Run

# Greedy evaluations in a run, and how many of the last ones count as the end.
EVALUATIONS, LAST = 15, 3
# Runs that a process trains at once.
CPU_RUNS, GPU_RUNS = 64, 320
# What tells a run from others, as text.
KEY = ("target", "source", "arm", "seed", "length", "learner")
# What a run reached, by its greedy evaluations: see `add_outcomes`.
OUTCOMES = ("area", "jumpstart", "end", "success")
Row = dict[str, Any]
# Trains runs of one length and one learner; returns a row of each.
Train = Callable[..., list[Row]]


@dataclass(frozen=True)
class Setting:
    """What is trained: cases, arms, and how long in environment steps.

    `scratch_seeds` is for the baselines alone.
    """

    overrides: tuple[str, ...]
    cases: tuple[str, ...]
    arms: tuple[str, ...]
    source_length: int
    target_length: int
    seeds: int
    scratch_seeds: int = 10


@dataclass(frozen=True)
class Task:
    """A run; without a source it learns from scratch, and `is_source` says that its network is kept."""

    target: str
    source: str
    arm: str
    seed: int
    is_source: bool = False
    # Of the source; None: the run's.
    source_seed: int | None = None
    # Changes of the setting's learner, as on a command line.
    learner: str = ""

    def length(self, setting: Setting) -> int:
        """Return how long the run is."""
        return setting.source_length if self.is_source else setting.target_length

    def key(self, setting: Setting) -> tuple[str, ...]:
        """Return what tells the run from others in the table."""
        length = str(self.length(setting))
        return self.target, self.source, self.arm, str(self.seed), length, self.learner

    def plan(self, setting: Setting, folder: Path) -> Run:
        """Plan the run; its source lies in the folder."""
        from ship_trl.run.plan import make_run

        config = shared_config((*setting.overrides, *self.learner.split()))
        arm, seed = Arm.parse(self.arm), self.seed if self.source_seed is None else self.source_seed
        source_file = str(weights_path(folder, self.source, seed)) if arm.has_trained_source else None
        config = replace(config, target=self.target, source=self.source or None, source_file=source_file)
        config = replace(config, method=arm.method, layers=arm.layers, source_weights=arm.weights)
        return make_run(replace(config, seed=self.seed))


@cache
def shared_config(overrides: tuple[str, ...]) -> Config:
    """Compose the configuration that all runs of a setting share, once a process."""
    from ship_trl.grid.compose import compose_config

    # No run writes there, but its plan looks whether the folder is free.
    output = f"output={tempfile.gettempdir()}/ship_trl_studies"
    words = ["profile=quick", "target=1", "method=scratch", "learn.jumpstart_draws=0", output, *overrides]
    return compose_config(*words)


def weights_path(folder: Path, case: str, seed: int) -> Path:
    """Return where a source's weights lie."""
    return folder / f"{case}-{seed}.safetensors"


def make_row(
    task: Task,
    setting: Setting,
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
    return {
        **{name: getattr(task, name) for name in ("target", "source", "arm", "seed")},
        "length": task.length(setting),
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


def keys(runs: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return what tells each run of a table from others."""
    return list(runs.reindex(columns=KEY, fill_value="").astype(str).itertuples(index=False, name=None))


def read_runs(folder: Path, wanted: Iterable[tuple[str, ...]], first: str) -> pd.DataFrame:
    """Read the table of runs beside a folder, just made or the one that was kept, and what each run reached.

    Raises:
        ConfigError: the file is missing or no such table; a run of `wanted`, which the command `first` makes,
            is missing, or one is there twice.
    """
    made, kept = folder.with_suffix(".csv"), folder.with_suffix(".csv.xz")
    path = made if made.is_file() else kept
    # Lists of numbers stay text, as names do.
    names = ("target", "source", "arm", "greedy", "reached", "source_greedy", "learner")
    try:
        runs = pd.read_csv(path, dtype=dict.fromkeys(names, str), keep_default_na=False)
        add_outcomes(runs)
    except FileNotFoundError:
        raise ConfigError(f"runs: no table {made}; allowed: after {first}") from None
    except (ValueError, KeyError, AttributeError, EOFError, lzma.LZMAError) as error:
        raise ConfigError(f"runs: {path} is not a table of runs: {error}") from None
    found = keys(runs)
    if len(set(found)) < len(found):
        raise ConfigError(f"runs: {path} has a run twice; allowed: once")
    if missing := set(wanted) - set(found):
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


def add_run_options(parser: Parser, settings: Iterable[str]) -> None:
    """Add the options of a command that makes the runs of a setting."""
    parser.add_argument("setting", choices=settings, help="what networks see")
    add_number(parser, "--processes", Positive, 2, "at once (default 2)")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default cpu")


def make_missing(tasks: list[Task], setting: Setting, folder: Path, train: Train, options: Namespace) -> None:
    """Make the runs that are not in the table beside the folder, sources first; a stopped study goes on."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder.with_suffix(".csv")
    runs = pd.read_csv(table, dtype=str, keep_default_na=False) if table.exists() else pd.DataFrame()
    done = set(keys(runs))
    tasks = [task for task in tasks if task.key(setting) not in done]
    processes, at_once = (1, GPU_RUNS) if options.device == "cuda" else (options.processes, CPU_RUNS)
    work, count = partial(train, setting=setting, folder=folder, device=options.device), 0
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=prepare) as pool:
        for stage in (True, False):
            groups = group([task for task in tasks if task.is_source is stage], at_once)
            jobs = [pool.submit(work, one) for one in groups]
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


def group(tasks: list[Task], at_once: int) -> list[list[Task]]:
    """Group the runs that are trained at once; they have one learner."""
    learners: dict[str, list[Task]] = {}
    for task in tasks:
        learners.setdefault(task.learner, []).append(task)
    return [one[at : at + at_once] for one in learners.values() for at in range(0, len(one), at_once)]


def prepare() -> None:
    """Configure a process of the pool."""
    from ship_trl.run.process import configure_process

    configure_process()
