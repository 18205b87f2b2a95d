"""`python -m benchmarks curves`: how soon learners avoid random encounters, in minutes of one core.

ship_trl and Stable-Baselines3's DQN and PPO learn from the same numbers on suite `traffic`, one after the
other. Every half minute of training, their greedy policies meet the scenes of `traffic_test`. Minutes are
processor time, evaluations not counted. ship_trl trains as `target=traffic method=scratch
observation=vector`, whose profile adds a cost of near passes to the reward; the others learn from the
environment's reward. Their settings are in benchmarks/peer_vector.py.
"""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from benchmarks.work import require_peers
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Seed
from ship_trl.config.schema import read_as

if TYPE_CHECKING:
    from benchmarks.peer_vector import Record
    from ship_trl.learn.rollout import Policy
    from ship_trl.sim.env import ShipEnv

TEST_SUITE, MINUTES = "traffic_test", 10.0
# Minutes of training between two evaluations.
EVERY = 0.5
# Shares of test scenes solved that the table has the minutes of.
GOALS = (0.90, 0.95)
TABLE, PICTURE = Path("outputs/curves.csv"), Path("outputs/curves.png")


@dataclass(frozen=True)
class Point:
    """The share of test scenes that a learner solves after some minutes and environment steps."""

    learner: str
    seed: int
    minutes: float
    steps: int
    success: float


class Curve:
    """The points of one training, whose clock starts at the first `record`."""

    def __init__(self, learner: str, seed: int, minutes: float, env: ShipEnv) -> None:
        self.learner, self.seed, self._limit, self._env = learner, seed, minutes, env
        self.points: list[Point] = []
        self._began = 0.0

    @property
    def name(self) -> str:
        """Name of learner and seed."""
        return f"{self.learner}, seed {self.seed}"

    def record(self, policy: Policy, steps: int, is_last: bool) -> bool:
        """Evaluate the policy if it is time to; return whether training goes on."""
        from ship_trl.learn.rollout import rollout

        now = time.process_time()
        if not self.points:
            self._began = now
        minutes = (now - self._began) / 60
        ends = is_last or minutes >= self._limit
        if ends or minutes >= EVERY * len(self.points):
            episodes = rollout(self._env, policy)
            success = sum(one.goal for one in episodes) / len(episodes)
            self.points.append(Point(self.learner, self.seed, minutes, steps, success))
            sys.stdout.write(f"{self.name}: {minutes:.1f} minutes, {steps:,} steps, {success:.1%}\n")
            self._began += time.process_time() - now
        return not ends

    def minutes_to(self, goal: float) -> float | None:
        """Return the minutes of the first point at a goal or above; None if there is none."""
        return next((one.minutes for one in self.points if one.success >= goal), None)


def main(arguments: list[str]) -> None:
    """Train all learners; write their curves and a picture, and print a table."""
    parser = make_parser("curves", f"{__doc__}\n\nWrites:\n    {TABLE}, {PICTURE}")
    parser.prog = "python -m benchmarks curves"
    positive = Annotated[float, Field(gt=0)]
    add_number(parser, "--minutes", positive, MINUTES, f"of each training, at most (default {MINUTES:g})")
    read_seed = partial(read_as, Seed, key="--seeds")
    parser.add_argument("--seeds", nargs="+", type=read_seed, default=[0], metavar="N", help="default 0")
    options = parser.parse_args(arguments)
    with refusals():
        require_peers()
        run(options)


def run(options: Namespace) -> None:
    """Train every learner with every seed, one after the other."""
    import torch
    from torch import Generator

    from benchmarks.peer_vector import train_dqn, train_ppo
    from ship_trl.fast.worlds import make_env, make_starts
    from ship_trl.run.process import configure_process, processor_name
    from ship_trl.sim.cases import load_world
    from ship_trl.sim.suites import load_suite
    from ship_trl.study.report.tables import write_csv

    learners: dict[str, Callable[[int, Record], None]] = {
        "ours": train_ours,
        "SB3 DQN": train_dqn,
        "SB3 PPO": train_ppo,
    }
    configure_process()
    sys.stdout.write(f"{processor_name()}, torch {torch.__version__}, {torch.get_num_threads()} thread\n")
    world = load_world()
    suite = load_suite(TEST_SUITE, world)
    starts = make_starts(suite, world).balanced(len(suite.cases), Generator())
    env, curves = make_env(suite, world, starts=starts), list[Curve]()
    TABLE.parent.mkdir(exist_ok=True)
    for seed in options.seeds:
        for name, train in learners.items():
            curve = Curve(name, seed, options.minutes, env)
            train(seed, curve.record)
            curves.append(curve)
            write_csv(TABLE, [asdict(point) for one in curves for point in one.points])
            draw(PICTURE, curves)
    print_curves(curves, options.minutes)
    sys.stdout.write(f"{TABLE}\n{PICTURE}\n")


def train_ours(seed: int, record: Record) -> None:
    """Train as a run does, but without its own evaluations, until `record` returns False."""
    from benchmarks.ours import Ours
    from benchmarks.work import plan

    words = ("target=traffic", "profile=traffic", "method=scratch", "observation=vector", f"seed={seed}")
    ours = Ours(plan(*words, "learn.evaluate_every=1000000", "learn.evaluate_episodes=1"))
    training, policy = ours.training, ours.algorithm.greedy
    training.begin()
    while record(policy, training.steps, training.is_finished):
        for _ in training.advance():
            pass


def print_curves(curves: Sequence[Curve], minutes: float) -> None:
    """Print the minutes to each goal, and the last share of test scenes solved."""
    from rich.console import Console
    from rich.table import Table

    table = Table("learner", *(f"minutes to {goal:.0%}" for goal in GOALS), "last", "steps")
    for curve in curves:
        found = [curve.minutes_to(goal) for goal in GOALS]
        cells = [f"not reached in {minutes:g} minutes" if one is None else f"{one:.1f}" for one in found]
        last = curve.points[-1]
        table.add_row(curve.name, *cells, f"{last.success:.1%}", f"{last.steps:,}")
    Console(highlight=False).print(table)


def draw(path: Path, curves: Sequence[Curve]) -> None:
    """Write a PNG of success over minutes, 1200 x 750: a colour a learner, a dash a seed."""
    from matplotlib.figure import Figure

    from ship_trl.view.style import CHART_DASHES, CHART_SERIES, MUTED, save_figure, tidy

    figure = Figure(figsize=(12, 7.5), dpi=100, layout="constrained")
    axes = figure.subplots()
    learners, seeds = ([*dict.fromkeys(getattr(one, key) for one in curves)] for key in ("learner", "seed"))
    for curve in curves:
        colour = CHART_SERIES[learners.index(curve.learner) % len(CHART_SERIES)]
        dash = CHART_DASHES[seeds.index(curve.seed) % len(CHART_DASHES)]
        minutes, success = zip(*((one.minutes, one.success) for one in curve.points), strict=True)
        axes.plot(minutes, success, color=colour, linestyle=dash, linewidth=2.2, label=curve.name)
    for goal in GOALS:
        axes.axhline(goal, color=MUTED, linewidth=1, linestyle=":")
    axes.set(ylim=(-0.02, 1.02), xlabel="minutes of one core", ylabel=f"share of {TEST_SUITE} solved")
    axes.set_title("Learning to avoid random encounters, seen as numbers", fontsize=15, loc="left")
    tidy(axes)
    axes.margins(x=0.01)
    axes.legend(loc="lower right", fontsize=12, frameon=False, handlelength=3)
    save_figure(figure, path)
