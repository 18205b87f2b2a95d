"""`python -m benchmarks similarity numbers|pixels`: which measure predicts what a source is worth?

Measures similarity of all pairs of the benchmark of sources, and judges the measures by docs/sources.md. The
networks are needed once; after that the table of measures is read.
"""

from __future__ import annotations

import math
import sys
import time
from argparse import Namespace
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import judge
from benchmarks.gains import KEPT, KINDS, Gains, make_gains, read_runs
from benchmarks.runs import key, prepare, weights_path
from benchmarks.sources import FOLDER, SETTINGS, plan_tasks
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, make_parser
from ship_trl.config.bounds import Positive
from ship_trl.config.errors import ConfigError
from ship_trl.files.table import read_table
from ship_trl.run.table import show
from ship_trl.sources.judgements import FITTED, ORACLE, Judgement, winner
from ship_trl.study.report.tables import write_csv
from ship_trl.study.statistics import Estimate

if TYPE_CHECKING:
    from benchmarks.probes import Probed

# What the paper says: equation 8.
PAPER = "similarity"
MAX_BYTES = 20_000_000
# Of cases, along an axis of the picture.
MAX_NAMES = 10
Floats = judge.Floats


def main(arguments: list[str]) -> None:
    """Measure, judge, and write tables and a picture."""
    files = "SETTING_measures.csv, SETTING_judgements.csv and SETTING.png"
    parser = make_parser("similarity", f"{__doc__}\n\nWrites:\n    {FOLDER}/{files}")
    parser.prog = "python -m benchmarks similarity"
    parser.add_argument("setting", choices=SETTINGS, help="what networks see")
    add_number(parser, "--processes", Positive, 2, "at once (default 2)")
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    with refusals():
        run(options)


def run(options: Namespace) -> None:
    """Judge all measures on all arms."""
    folder = FOLDER / options.setting
    setting, runs = SETTINGS[options.setting], read_runs(run_table(folder))
    if missing := {task.key(setting) for task in plan_tasks(setting)} - set(map(key, runs)):
        first = f"python -m benchmarks sources {folder.name}"
        raise ConfigError(f"sources: {len(missing)} runs are missing; allowed: after {first}")
    gains = make_gains(runs, setting.cases)
    table = folder.with_name(f"{folder.name}_measures.csv")
    if not table.is_file():
        write_csv(table, measure_all(gains.cases, setting.seeds, folder, options.processes))
    values, seconds = read_measures(table, gains.cases, setting.seeds)
    judged = {
        arm: one for arm in gains.arms if judge.reliability(one := gains.of(arm))[0] > judge.MIN_RELIABILITY
    }
    judgements = judge_all(values, seconds, judged)
    show_arms(gains, options.markdown)
    picture = folder.with_suffix(".png")
    if not judgements:
        draw(picture, gains, most_gaining(gains), {PAPER: values[PAPER]})
        sys.stdout.write(f"no arm is judged: seeds agree too little\n{table}\n{picture}\n")
        return
    show_judgements(judgements, options.markdown)
    best = winner(judgements)
    apart = judge.difference(values[best.measure], values[PAPER], judged.values())
    sys.stdout.write(
        f"the winner is {best.measure}: mean correlation above that of equation 8 by {interval(apart, 2)}; "
        f"its first sources gain most with {best.arm}, "
        f"{interval(Estimate(best.gain, best.gain_low, best.gain_high))}\n"
    )
    written = folder.with_name(f"{folder.name}_judgements.csv")
    write_csv(written, [asdict(one) for one in judgements])
    draw(picture, gains, best.arm, {name: values[name] for name in dict.fromkeys((PAPER, best.measure))})
    sys.stdout.write("".join(f"{path}\n" for path in (table, written, picture)))


def most_gaining(gains: Gains) -> str:
    """Return the arm with the largest mean gain."""
    return max(gains.arms, key=lambda arm: float(np.nanmean(gains.of(arm))))


def run_table(folder: Path) -> Path:
    """Return where the table of runs lies: the one just made, or the one that was kept."""
    made = folder.with_suffix(".csv")
    return made if made.is_file() else folder.with_suffix(".csv.xz")


def measure_all(cases: tuple[str, ...], seeds: int, folder: Path, processes: int) -> list[dict[str, Any]]:
    """Measure the similarity of each source to each target, a row for each pair and seed."""
    jobs = [(cases, target, seed, folder) for seed in range(seeds) for target in cases]
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=prepare) as pool:
        return [row for rows in pool.map(measure, *zip(*jobs, strict=True)) for row in rows]


def measure(cases: tuple[str, ...], target: str, seed: int, folder: Path) -> list[dict[str, Any]]:
    """Measure the similarity of all sources to a target; `NAME seconds` is the processor time of each."""
    from benchmarks.measures import MEASURES

    rows = []
    for source in cases:
        if source == target:
            continue
        row: dict[str, Any] = {"target": target, "source": source, "seed": seed}
        pair = known(folder, source, seed), known(folder, target, seed)
        # The first measures would pay for what later ones share.
        _ = pair[0].probe, pair[1].probe, pair[0].own_episode, pair[1].planned_episode, pair[1].bounds
        for name, one in MEASURES.items():
            began = time.process_time()
            row[name] = f"{one.value(*pair):.6g}"
            row[f"{name} seconds"] = f"{time.process_time() - began:.4f}"
        rows.append(row)
    return rows


@cache
def known(folder: Path, case: str, seed: int) -> Probed:
    """Read a source's network, once a process."""
    from benchmarks.probes import Probed
    from ship_trl.sim.cases import load_case, load_world

    world = load_world()
    return Probed.load(load_case(case, world, "source"), world, weights_path(folder, case, seed))


def read_measures(
    path: Path, cases: tuple[str, ...], seeds: int
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Read the mean over seeds of each measure, [targets, sources], larger for more similar, and its seconds.

    Raises:
        ConfigError: the table is not whole.
    """
    from benchmarks.measures import MEASURES

    rows = read_table(path, ("target", "source", "seed", *MEASURES), dict, MAX_BYTES, "sources", "measures")
    pairs = len(cases) * (len(cases) - 1)
    wanted = {(t, s, str(seed)) for t in cases for s in cases if s != t for seed in range(seeds)}
    if sorted((row["target"], row["source"], row["seed"]) for row in rows) != sorted(wanted):
        raise ConfigError(f"sources: {path} does not fit the runs; delete it to measure again")
    values, seconds = {}, {}
    for name, one in MEASURES.items():
        total = np.zeros((len(cases), len(cases)))
        np.fill_diagonal(total, np.nan)
        for row in rows:
            total[cases.index(row["target"]), cases.index(row["source"])] += float(row[name])
        values[name] = (-1 if one.nearer else 1) * total * pairs / len(rows)
        seconds[name] = float(np.mean([float(row[f"{name} seconds"]) for row in rows]))
    return values, seconds


def judge_all(
    values: Mapping[str, Floats], seconds: Mapping[str, float], judged: Mapping[str, Floats]
) -> list[Judgement]:
    """Judge every measure, and what is fitted, on the arms that are judged."""
    from benchmarks.measures import KINDS

    free = {name: value for name, value in values.items() if KINDS[name] != ORACLE}
    found = []
    for arm, gains in judged.items():
        fitted = {"elsewhere": judge.elsewhere(gains), "regression": judge.regression(free, gains)}
        for name, value in {**values, **fitted}.items():
            judged_by = judge.judge(value, gains).values()
            numbers = [number for one in judged_by for number in (one.value, one.low, one.high)]
            rounded = [round(number, 4) for number in (*numbers, seconds.get(name, 0.0))]
            found.append(Judgement(name, KINDS.get(name, FITTED), arm, *rounded))
    return found


def show_arms(gains: Gains, markdown: bool) -> None:
    """Print the mean gains of each arm, and how well seeds agree."""
    rows = []
    for arm in gains.arms:
        one, both = judge.reliability(gains.of(arm))
        cells = [interval(judge.interval(np.nanmean(gains.of(arm, kind), axis=(0, 2)))) for kind in KINDS]
        best = judge.interval(np.nanmax(gains.of(arm).mean(0), axis=1)).value
        share = float(np.mean(gains.of(arm).mean(0)[np.isfinite(gains.of(arm)[0])] > 0))
        kept = float(np.nanmean(gains.of(arm, KEPT)))
        rows.append([arm, *cells, f"{share:.0%}", f"{best:+.3f}", f"{kept:.2f}", f"{one:.2f}", f"{both:.2f}"])
    headings = ("arm", *(f"gain: {kind}" for kind in KINDS), "pairs that gain", "of the best source", "kept")
    show((*headings, "reliability of a seed", "of the mean"), rows, markdown)


def interval(one: Estimate, digits: int = 3) -> str:
    """Write a mean with its interval."""
    value, low, high = (f"{number:+.{digits}f}" for number in (one.value, one.low, one.high))
    return f"{value} ({low} to {high})"


def show_judgements(judgements: list[Judgement], markdown: bool) -> None:
    """Print a row for each measure, with the correlation, regret and hits of each arm."""
    arms = list(dict.fromkeys(one.arm for one in judgements))
    names = list(dict.fromkeys(one.measure for one in judgements))
    rows = []
    for name in names:
        own = [one for one in judgements if one.measure == name]
        spans = [Estimate(o.correlation, o.correlation_low, o.correlation_high) for o in own]
        cells = [interval(span, 2) for span in spans]
        cells += [f"{one.regret:.3f}" for one in own] + [f"{one.top:.0%}" for one in own]
        rows.append([name, own[0].kind, *cells, f"{own[0].seconds:.3f}"])
    groups = [f"{what}, {arm}" for what in ("correlation", "regret", "top 3") for arm in arms]
    show(("measure", "knows", *groups, "seconds"), rows, markdown)


def draw(path: Path, gains: Gains, arm: str, values: Mapping[str, Floats]) -> None:
    """Write a PNG: gains of all pairs, and measures of similarity as ranks within each target."""
    from matplotlib.figure import Figure

    from ship_trl.view.chart import save

    mean = gains.of(arm).mean(0)
    panels = {f"gain of {arm} over scratch": mean}
    names = {PAPER: "equation 8"}
    panels |= {
        f"{names.get(name, name)}: rank of similarity": judge.shares(value) for name, value in values.items()
    }
    figure = Figure(figsize=(3.7 * len(panels), 4.2), dpi=100, layout="constrained")
    # Few enough names to be read where the picture is as wide as a page.
    named = range(0, len(gains.cases), math.ceil(len(gains.cases) / MAX_NAMES))
    names_of_cases = [gains.cases[at] for at in named]
    reach = float(np.nanpercentile(np.abs(mean), 98))
    for number, (axes, (title, panel)) in enumerate(
        zip(figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True)
    ):
        colours, low, high = ("RdBu", -reach, reach) if number == 0 else ("Blues", 0, 1)
        image = axes.imshow(panel, cmap=colours, vmin=low, vmax=high)
        axes.set_xticks(named, names_of_cases, rotation=90, fontsize=10)
        axes.set_yticks(named, names_of_cases, fontsize=10)
        axes.set_xlabel("source", fontsize=11)
        axes.set_ylabel("target", fontsize=11)
        axes.set_title(title, fontsize=11, loc="left")
        axes.set_facecolor("#D4D4D4")
        figure.colorbar(image, ax=axes, location="bottom", shrink=0.8)
    save(figure, path)
