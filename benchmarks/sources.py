"""`python -m benchmarks sources numbers|pixels`: train every case's network further on every other case.

Which source is worth most to a target? Each case is learned from scratch with a few seeds; each network is
then carried to all other cases by a few arms. Runs from scratch of the target's length are the baseline.
docs/sources.md has the plan and what was found. Runs that are in the table already are not made again, so
that a stopped benchmark goes on.
"""

from __future__ import annotations

import csv
import sys
import time
from argparse import Namespace
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.work import plan
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.arm import SCRATCH, Arm
from ship_trl.config.bounds import Positive
from ship_trl.config.types import Config
from ship_trl.study.report.tables import write_csv

if TYPE_CHECKING:
    from benchmarks.ours import Ours

FOLDER = Path("outputs/sources")
PAPER = ("1", "2", "3", "4", "5", "6", "new")
IMAZU = tuple(f"imazu{number:02}" for number in range(1, 23))
# Greedy evaluations in a run, and how many of them are also made on the source's case.
EVALUATIONS, ON_SOURCE = 15, 5


@dataclass(frozen=True)
class Price:
    """What is trained: cases, arms, and how long; `scratch_seeds` is for the baselines alone."""

    overrides: tuple[str, ...]
    cases: tuple[str, ...]
    arms: tuple[str, ...]
    source_episodes: int
    target_episodes: int
    seeds: int = 2
    scratch_seeds: int = 10


PRICES = {
    # Small, and many environments and episodes at once, so that a run takes seconds.
    "numbers": Price(
        (
            *("observation=vector", "algorithm=n_step", "network.linear=[64,64,128,128]"),
            *("learn.num_envs=32", "learn.batch_size=128", "learn.update_every=16"),
            *("learn.lr=1e-3", "learn.warmup_steps=500"),
        ),
        PAPER + IMAZU,
        ("FE2", "FTW", "FTH"),
        source_episodes=1200,
        target_episodes=300,
    ),
    # Profile quick. The Imazu problems with one, two and three ships whose best known return is lowest.
    "pixels": Price(
        ("observation=pixels",),
        (*PAPER, "imazu03", "imazu07", "imazu17"),
        ("FE3", "FTW", "FTH"),
        source_episodes=600,
        target_episodes=300,
    ),
}


@dataclass(frozen=True)
class Task:
    """A run; without a source it learns from scratch, and `is_source` says that its network is kept."""

    target: str
    source: str
    arm: str
    seed: int
    is_source: bool = False

    def episodes(self, price: Price) -> int:
        """Return how long the run is."""
        return price.source_episodes if self.is_source else price.target_episodes

    def key(self, price: Price) -> tuple[str, ...]:
        """Return what tells the run from others in the table."""
        return key(asdict(self) | {"episodes": self.episodes(price)})


@dataclass(frozen=True)
class Row:
    """A finished run.

    `greedy` are greedy returns at equal distances, the first before training; `reached` has a 1 where the
    goal was reached; `source_greedy` are returns on the source's case; `training` are mean returns of the
    training episodes, in tenths. Lists are written with spaces. `seconds` is processor time.
    """

    target: str
    source: str
    arm: str
    seed: int
    episodes: int
    random: float
    best_known: float
    greedy: str
    reached: str
    source_greedy: str
    training: str
    seconds: float


def plan_tasks(price: Price) -> list[Task]:
    """List all runs: sources, baselines, then transfers, a seed after the other."""
    cases, seeds = price.cases, range(price.seeds)
    tasks = [Task(case, "", SCRATCH.name, seed, True) for seed in seeds for case in cases]
    tasks += [Task(case, "", SCRATCH.name, seed) for seed in range(price.scratch_seeds) for case in cases]
    pairs = [(source, target) for target in cases for source in cases if source != target]
    return tasks + [
        Task(target, source, arm, seed) for seed in seeds for source, target in pairs for arm in price.arms
    ]


@cache
def shared_config(overrides: tuple[str, ...]) -> Config:
    """Compose the configuration that all runs of a price share, once a process."""
    return plan("profile=quick", "target=1", "method=scratch", *overrides).config


def weights_path(folder: Path, case: str, seed: int) -> Path:
    """Return where a source's weights lie."""
    return folder / f"{case}-{seed}.safetensors"


def train(task: Task, price: Price, folder: Path) -> Row:
    """Train one run; a source's best network is written into the folder."""
    from benchmarks.ours import Ours
    from ship_trl.learn.train import Evaluated
    from ship_trl.run.plan import make_run
    from ship_trl.transfer.layers import save_weights

    began, arm = time.process_time(), Arm.parse(task.arm)
    config = shared_config(price.overrides)
    episodes = task.episodes(price)
    learn = replace(config.learn, episodes=episodes, evaluate_every=episodes // EVALUATIONS)
    source_file = None if arm.is_scratch else str(weights_path(folder, task.source, task.seed))
    run = make_run(
        replace(
            config,
            target=task.target,
            source=task.source or None,
            source_file=source_file,
            method=arm.method,
            layers=arm.layers,
            seed=task.seed,
            learn=learn,
        )
    )
    ours = Ours(run)
    training, greedy, returns = ours.training, list[Evaluated](), list[float]()
    on_source = [] if arm.is_scratch else [source_return(ours, task.source)]

    def evaluated(event: Evaluated) -> None:
        greedy.append(event)
        if task.is_source and event.episode_return >= max(one.episode_return for one in greedy):
            about = {"config_hash": run.config_hash, "episode": event.episode}
            save_weights(weights_path(folder, task.target, task.seed), ours.algorithm.network, about)
        if on_source and event.episode and len(greedy) % (EVALUATIONS // ON_SOURCE) == 1:
            on_source.append(source_return(ours, task.source))

    evaluated(training.begin())
    while not training.is_finished:
        for event in training.advance():
            if isinstance(event, Evaluated):
                evaluated(event)
            else:
                returns.append(event.episode_return)
    tenth = len(returns) // 10
    means = [sum(returns[at : at + tenth]) / tenth for at in range(0, tenth * 10, tenth)]
    random, known = bounds(task.target)
    return Row(
        target=task.target,
        source=task.source,
        arm=task.arm,
        seed=task.seed,
        episodes=episodes,
        random=round(random, 2),
        best_known=round(known, 2),
        greedy=join(one.episode_return for one in greedy),
        reached="".join(str(int(one.success_rate)) for one in greedy),
        source_greedy=join(on_source),
        training=join(means),
        seconds=round(time.process_time() - began, 2),
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


def source_return(ours: Ours, case: str) -> float:
    """Return the greedy return on another case of the network that is being trained."""
    from ship_trl.learn.rollout import rollout
    from ship_trl.sim.env import ShipEnv
    from ship_trl.sim.suites import load_suite

    world = ours.run.config.world
    (episode,) = rollout(ShipEnv(load_suite(case, world), world), ours.algorithm.greedy)
    return episode.episode_return


def join(values: Iterable[float]) -> str:
    """Write numbers with spaces between them."""
    return " ".join(f"{value:.2f}" for value in values)


def read_done(table: Path) -> list[dict[str, str]]:
    """Read the rows of the table; a last line that a kill cut off is left out."""
    if not table.exists():
        return []
    with table.open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["seconds"]]


def key(row: Mapping[str, object]) -> tuple[str, ...]:
    """Return what tells a run from others."""
    return tuple(str(row[name]) for name in ("target", "source", "arm", "seed", "episodes"))


def main(arguments: list[str]) -> None:
    """Make the runs that are missing, and add them to the table."""
    parser = make_parser("sources", f"{__doc__}\n\nWrites:\n    {FOLDER}/PRICE.csv and the sources' weights")
    parser.prog = "python -m benchmarks sources"
    parser.add_argument("price", choices=PRICES, help="what networks see")
    add_number(parser, "--processes", Positive, 2, "at once (default 2)")
    add_number(parser, "--runs", Positive, None, "stop after so many")
    options = parser.parse_args(arguments)
    with refusals():
        run(options)


def run(options: Namespace) -> None:
    """Train sources first; then everything else."""
    price, folder = PRICES[options.price], FOLDER / options.price
    folder.mkdir(parents=True, exist_ok=True)
    table = folder.with_suffix(".csv")
    rows: list[Mapping[str, object]] = list(read_done(table))
    done = {key(row) for row in rows}
    write_csv(table, rows)
    tasks = [task for task in plan_tasks(price) if task.key(price) not in done][: options.runs]
    with (
        ProcessPoolExecutor(options.processes, get_context("spawn"), initializer=prepare) as pool,
        table.open("a", newline="") as file,
    ):
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        if not rows:
            writer.writeheader()
        for stage in (True, False):
            jobs = [pool.submit(train, task, price, folder) for task in tasks if task.is_source is stage]
            for count, job in enumerate(as_completed(jobs), 1):
                row = job.result()
                writer.writerow(asdict(row))
                file.flush()
                where = f"{row.source or 'nothing'} to {row.target}, {row.arm}, seed {row.seed}"
                sys.stdout.write(f"{count} of {len(jobs)}: {where}, {row.seconds} s\n")
    sys.stdout.write(f"{table}\n")


def prepare() -> None:
    """Configure a process of the pool."""
    from ship_trl.run.process import configure_process

    configure_process()
