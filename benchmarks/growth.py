"""`python -m benchmarks growth`: time and memory against ships, environments, replay and agents in lockstep.

Every size of a part takes turns with the others, and the fastest of its rounds counts. A slope is that of the
logarithms between two neighbouring sizes: 0 costs nothing more, 1 is in proportion.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import matplotlib
import torch
from matplotlib.figure import Figure
from torch import Generator

from benchmarks.curves import RUN
from benchmarks.ours import CASE, Ours, plan, plan_run
from benchmarks.sizes import held_bytes
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.fast.worlds import make_env
from ship_trl.run.console import show
from ship_trl.run.lockstep import make_lockstep, starts
from ship_trl.run.process import configure_process, processor_name
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.view.style import CHART, CHART_SERIES, MUTED, save_figure

PICTURE = Path("outputs/growth.png")
SHIPS = (1, 2, 4, 6, 8, 12)
ENVIRONMENTS = (1, 4, 16, 64, 256, 1024)
REPLAY = (10_000, 30_000, 100_000, 300_000, 1_000_000)
AGENTS = (1, 4, 16, 64)
# Environment steps of each agent in a measurement, and seconds that another measurement lasts at least.
AGENT_STEPS, SECONDS = 32, 0.2
# From here on time or memory grows in proportion, and a larger size gains nothing.
BENT = 0.9


class Line(NamedTuple):
    """What grows: work in seconds or bytes for each size."""

    part: str
    name: str
    sizes: Sequence[int]
    values: list[float]
    unit: str = "s"

    @property
    def slopes(self) -> list[float]:
        """The slope before each size but the first."""
        pairs = zip(self.sizes, self.values, strict=True)
        logs = [(math.log(size), math.log(value)) for size, value in pairs]
        return [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(logs)]

    @property
    def bend(self) -> int | None:
        """The size from which it grows in proportion; None if it never does."""
        steep = [slope >= BENT for slope in self.slopes]
        first = next((k for k in range(len(steep)) if all(steep[k:])), None)
        return None if first is None else self.sizes[first]


def main(arguments: Sequence[str]) -> None:
    """Measure all parts, print a table, and write the picture."""
    parser = make_parser("", f"{__doc__}\n\nWrites:\n    {PICTURE}")
    parser.prog = "python -m benchmarks growth"
    add_number(parser, "--rounds", Positive, 5, "of which the fastest counts (default 5)")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_args(arguments)
    configure_process()
    sys.stdout.write(f"{processor_name()}, torch {torch.__version__}, {torch.get_num_threads()} thread\n")
    lines = [line for part in PARTS for line in part(options.rounds)]
    rows = []
    for line in lines:
        first, last = (f"{value:.3g}" for value in (line.values[0], line.values[-1]))
        bend = "never" if line.bend is None else f"{line.bend:,}"
        rows.append([line.part, line.name, f"{line.sizes[0]:,} to {line.sizes[-1]:,}", first, last, bend])
    headings = ("of", "what (s or bytes)", "sizes", "first", "last", "in proportion from")
    show(headings, rows, options.markdown)
    draw(PICTURE, lines)
    sys.stdout.write(f"{PICTURE}\n")


def fastest(runs: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """Return the least seconds of a call of each; they take turns."""
    found = [math.inf] * len(runs)
    for run in runs:
        run()
    for _ in range(rounds):
        for k, run in enumerate(runs):
            count, began = 0, time.perf_counter()
            while (elapsed := time.perf_counter() - began) < SECONDS or not count:
                run()
                count += 1
            found[k] = min(found[k], elapsed / max(1, count))
    return found


def stepper(env: ShipEnv, seed: int = 0) -> Callable[[], object]:
    """Return a function that steps all environments with random actions."""
    count = env.batch_size[0]
    actions = torch.randint(len(env.world.actions), (64, count), generator=Generator().manual_seed(seed))
    state = [env.reset(), 0]

    def step() -> None:
        current, taken = state
        _, state[0] = env.step_and_maybe_reset(current.set("action", actions[taken % 64]))
        state[1] = taken + 1

    return step


def scenes(ships: int, count: int) -> ShipEnv:
    """Make environments of random encounters with this number of ships."""
    suite = load_suite("traffic", load_world())
    assert suite.traffic is not None
    traffic = replace(suite.traffic, ships=[0.0] * ships + [1.0], reacting=0.0)
    return make_env(
        replace(suite, traffic=traffic), load_world(), count, generator=Generator().manual_seed(0)
    )


def learner(ships: int, *words: str) -> Ours:
    """Put together a run from numbers whose environment has this number of ships in each scene."""
    ours = Ours(plan(*RUN, f"network.ships={max(SHIPS)}", *words))
    ours.env = scenes(ships, ours.learn.num_envs)
    return ours


def grow_ships(rounds: int) -> list[Line]:
    """Measure steps of 64 environments, and updates of 512 transitions, for numbers of ships."""
    learners = [learner(ships) for ships in SHIPS]
    for ours in learners:
        ours.fill(4096)
    updates = [partial(ours.algorithm.learn_from, ours.sample()) for ours in learners]
    steps = [stepper(scenes(ships, 64)) for ships in SHIPS]
    return [
        Line("ships", "step of 64 environments", SHIPS, fastest(steps, rounds)),
        Line("ships", "update from numbers, batch of 512", SHIPS, fastest(updates, rounds)),
    ]


def grow_environments(rounds: int) -> list[Line]:
    """Measure steps without and with drawing, for numbers of environments."""
    suite, world = load_suite("traffic", load_world()), load_world()
    kinds = {"step": {}, "step and pixels": {"from_pixels": True}}
    found = []
    for name, given in kinds.items():
        generators = [Generator().manual_seed(0) for _ in ENVIRONMENTS]
        envs = [
            make_env(suite, world, count, generator=generator, **given)
            for count, generator in zip(ENVIRONMENTS, generators, strict=True)
        ]
        found.append(Line("environments", name, ENVIRONMENTS, fastest([*map(stepper, envs)], rounds)))
    return found


def grow_replay(rounds: int) -> list[Line]:
    """Measure draws of 512 transitions, and bytes, for sizes of a full replay."""
    learners = [learner(6, f"learn.replay_size={size}", "learn.num_envs=1000") for size in REPLAY]
    for ours, size in zip(learners, REPLAY, strict=True):
        ours.fill(size)
        assert len(ours.replay) == size
    sizes = [float(held_bytes(ours.replay)) for ours in learners]
    draws = fastest([ours.sample for ours in learners], rounds)
    return [
        Line("replay", "draw of 512 transitions", REPLAY, draws),
        Line("replay", "memory, six ships", REPLAY, sizes, "byte"),
    ]


def grow_agents(rounds: int) -> list[Line]:
    """Measure training loops in lockstep from pixels, for numbers of agents."""
    loops = []
    for count in AGENTS:
        runs = [plan_run("scratch", (f"seed={seed}",)) for seed in range(count)]
        agents, _ = make_lockstep(runs, starts(runs, [CASE] * count), 1_000_000)
        agents.train(runs[0].config.learn.warmup_steps + AGENT_STEPS)
        loops.append(partial(agents.train, AGENT_STEPS))
    return [Line("agents", f"{AGENT_STEPS} steps in lockstep, pixels", AGENTS, fastest(loops, rounds))]


@matplotlib.rc_context(CHART)
def draw(path: Path, lines: Sequence[Line]) -> None:
    """Write a PNG, 1200 x 900: a panel for each part, and at each line the slope of its end."""
    figure = Figure(figsize=(12, 9), dpi=100)
    panels = figure.subplots(2, 2).flat
    for panel, part in zip(panels, dict.fromkeys(line.part for line in lines), strict=True):
        own = [line for line in lines if line.part == part]
        for line, colour in zip(own, CHART_SERIES, strict=False):
            times = [value / line.values[0] for value in line.values]
            label = f"{line.name}: {line.slopes[-1]:.2f}"
            panel.loglog(line.sizes, times, color=colour, linewidth=2.2, marker="o", label=label)
        sizes = own[0].sizes
        panel.loglog(
            sizes, [size / sizes[0] for size in sizes], color=MUTED, linestyle=":", label="proportion: 1"
        )
        panel.set(xlabel=part, ylabel="times the first")
        panel.set_xticks(sizes, [f"{size:,}" for size in sizes])
        panel.minorticks_off()
        panel.yaxis.set_major_formatter("{x:,.0f}")
        panel.legend(loc="lower left", bbox_to_anchor=(0, 1), fontsize=10)
    figure.suptitle(
        "What grows with size; behind each line's name its last slope", fontsize=15, x=0.01, ha="left"
    )
    save_figure(figure, path)


PARTS = (grow_ships, grow_environments, grow_replay, grow_agents)
