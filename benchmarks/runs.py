"""Runs of the benchmark of sources and of the second study: what one is, its row, and making those that lack.

Runs are trained many at once. Those that are in the table already are not made again.
"""

from __future__ import annotations

import csv
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.work import plan
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.arm import Arm
from ship_trl.config.bounds import Positive
from ship_trl.config.types import Config
from ship_trl.study.report.tables import write_csv

if TYPE_CHECKING:
    from ship_trl.run.run import Run

# Greedy evaluations in a run, and how many of them are also made on the source's case.
EVALUATIONS, ON_SOURCE = 15, 5

# Runs that a process trains at once.
CPU_RUNS, GPU_RUNS = 64, 320


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
        return key(asdict(self) | {"length": self.length(setting)})

    def plan(self, setting: Setting, folder: Path) -> Run:
        """Plan the run; its source lies in the folder."""
        from ship_trl.run.plan import make_run

        config = shared_config((*setting.overrides, *self.learner.split()))
        arm, seed = Arm.parse(self.arm), self.seed if self.source_seed is None else self.source_seed
        source_file = str(weights_path(folder, self.source, seed)) if arm.has_trained_source else None
        config = replace(config, target=self.target, source=self.source or None, source_file=source_file)
        config = replace(config, method=arm.method, layers=arm.layers, source_weights=arm.weights)
        return make_run(replace(config, seed=self.seed))


@dataclass(frozen=True)
class Row:
    """A finished run.

    `greedy` are greedy returns at equal distances, the first before training; `reached` has a 1 where the
    goal was reached; `source_greedy` are returns on the source's case. Lists are written with spaces.
    `seconds` is processor time.
    """

    target: str
    source: str
    arm: str
    seed: int
    length: int
    random: float
    best_known: float
    greedy: str
    reached: str
    source_greedy: str
    seconds: float


@cache
def shared_config(overrides: tuple[str, ...]) -> Config:
    """Compose the configuration that all runs of a setting share, once a process."""
    return plan("profile=quick", "target=1", "method=scratch", *overrides).config


def weights_path(folder: Path, case: str, seed: int) -> Path:
    """Return where a source's weights lie."""
    return folder / f"{case}-{seed}.safetensors"


def is_on_source(evaluation: int) -> bool:
    """Return whether an evaluation, 0 before training, is made on the source's case too."""
    return evaluation % (EVALUATIONS // ON_SOURCE) == 0


def make_row(
    task: Task,
    setting: Setting,
    greedy: Iterable[float],
    reached: Iterable[float],
    on_source: Iterable[float],
    seconds: float,
) -> Row:
    """Make the row of a run."""
    random, known = bounds(task.target)
    return Row(
        target=task.target,
        source=task.source,
        arm=task.arm,
        seed=task.seed,
        length=task.length(setting),
        random=round(random, 2),
        best_known=round(known, 2),
        greedy=join(greedy),
        reached="".join(str(int(one)) for one in reached),
        source_greedy=join(on_source),
        seconds=round(seconds, 2),
    )


@cache
def bounds(case: str) -> tuple[float, float]:
    """Return the mean return of random actions in a case, and the best known return."""
    from ship_trl.policies.random_policy import random_return
    from ship_trl.policies.reference import best_known_return
    from ship_trl.sim.cases import load_world
    from ship_trl.sim.suites import load_suite

    world = load_world()
    suite = load_suite(case, world)
    known = best_known_return(suite, world, max_searches=1)
    assert known is not None
    return random_return(suite, world), known


def join(values: Iterable[float]) -> str:
    """Write numbers with spaces between them."""
    return " ".join(f"{value:.2f}" for value in values)


def read_done(table: Path) -> list[dict[str, str]]:
    """Read the rows of the table; a last line that a kill cut off is left out."""
    if not table.exists():
        return []
    whole = table.read_text().rpartition("\n")[0]
    return list(csv.DictReader(whole.splitlines()))


def key(row: Mapping[str, object]) -> tuple[str, ...]:
    """Return what tells a run from others."""
    return tuple(str(row.get(name, "")) for name in ("target", "source", "arm", "seed", "length", "learner"))


def read_and_run(
    name: str,
    about: str,
    folder: Path,
    settings: Iterable[str],
    run: Callable[[Namespace], None],
    arguments: list[str],
) -> None:
    """Read the options of a command that makes runs of a setting, and run it."""
    words = f"{about}\n\nWrites:\n    {folder}/SETTING.csv and the sources' weights"
    parser = make_parser(name, words)
    parser.prog = f"python -m benchmarks {name}"
    parser.add_argument("setting", choices=settings, help="what networks see")
    add_number(parser, "--processes", Positive, 2, "at once (default 2)")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="default cpu")
    with refusals():
        run(parser.parse_args(arguments))


def make_missing(
    tasks: list[Task],
    setting: Setting,
    folder: Path,
    kind: type[Row],
    train: Callable[[list[Task]], list[Row]],
    options: Namespace,
) -> None:
    """Make the runs that are not in the table beside the folder, a row of some kind each; sources first."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder.with_suffix(".csv")
    rows: list[Mapping[str, object]] = list(read_done(table))
    done = {key(row) for row in rows}
    write_csv(table, rows)
    tasks = [task for task in tasks if task.key(setting) not in done]
    count = 0
    processes, at_once = (1, GPU_RUNS) if options.device == "cuda" else (options.processes, CPU_RUNS)
    with (
        ProcessPoolExecutor(processes, get_context("spawn"), initializer=prepare) as pool,
        table.open("a", newline="") as file,
    ):
        writer = csv.DictWriter(file, [field.name for field in fields(kind)], lineterminator="\n")
        if not rows:
            writer.writeheader()
        for stage in (True, False):
            groups = group([task for task in tasks if task.is_source is stage], at_once)
            jobs = [pool.submit(train, one) for one in groups]
            try:
                for job in as_completed(jobs):
                    made = job.result()
                    writer.writerows(asdict(row) for row in made)
                    file.flush()
                    count += len(made)
                    seconds = sum(row.seconds for row in made)
                    where = f"to {made[-1].target}, {seconds:.1f} s of a core"
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
