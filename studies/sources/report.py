"""Measure similarity of all pairs, judge the measures by README.md, and print and draw what was found.

The networks are needed once; after that the table of measures is read.
"""

from __future__ import annotations

import math
import sys
import time
from argparse import Namespace
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ship_trl.config.errors import ConfigError
from ship_trl.run.console import show
from ship_trl.run.process import configure_process
from ship_trl.study.report.tables import write_csv
from ship_trl.study.statistics import Estimate
from studies.lockstep import OUTCOMES, read_runs, weights_path
from studies.sources import judge
from studies.sources.plan import FOLDER, SETTINGS, Setting, plan_tasks

if TYPE_CHECKING:
    from studies.sources.measures import Known

# What the paper says: equation 8.
PAPER = "similarity"
# Of cases, along an axis of the picture.
MAX_NAMES = 10
Floats = judge.Floats
# By arm and kind.
Gains = Mapping[tuple[str, str], Floats]


def report(options: Namespace) -> None:
    """Judge all measures on all arms; print, and write tables and a picture."""
    folder, setting = FOLDER / options.setting, SETTINGS[options.setting]
    runs = read_runs(folder, plan_tasks(setting), f"python -m studies.sources run {folder.name}")
    gains = judge.make_gains(runs, setting.cases)
    areas = {arm: one for (arm, kind), one in gains.items() if kind == "area"}
    table = folder.with_name(f"{folder.name}_measures.csv")
    if not table.is_file():
        # A row for each pair and seed.
        jobs = zip(*((case, seed) for seed in range(setting.seeds) for case in setting.cases), strict=True)
        with ProcessPoolExecutor(
            options.processes, get_context("spawn"), initializer=configure_process
        ) as pool:
            made = pool.map(partial(measure, setting, folder), *jobs)
            write_csv(table, [row for rows in made for row in rows])
    by_seed, seconds = read_measures(table, setting.cases, setting.seeds)
    # The kept table has these roundings, which decide between sources that tie.
    pairs = len(setting.cases) * (len(setting.cases) - 1)
    values = {name: each.sum(0) * pairs / (pairs * setting.seeds) for name, each in by_seed.items()}
    judged = {arm: one for arm, one in areas.items() if judge.reliability(one)[0] > judge.MIN_RELIABILITY}
    show_arms(gains, areas, options.markdown)
    picture = folder.with_suffix(".png")
    if not judged:
        most = max(areas, key=lambda arm: float(np.nanmean(areas[arm])))
        draw(picture, setting.cases, most, areas[most], {PAPER: values[PAPER]})
        sys.stdout.write(f"no arm is judged: seeds agree too little\n{table}\n{picture}\n")
        return
    judgements = judge_all(values, seconds, judged)
    show_judgements(judgements, options.markdown)
    best = judge.winner(judgements)
    apart = judge.difference(values[best["measure"]], values[PAPER], judged.values())
    sys.stdout.write(
        f"the winner is {best['measure']}: mean correlation above that of equation 8 by {apart.words('+')};"
        f" its first sources gain most with {best['arm']}, {estimate(best, 'gain').words('+', 3)}\n"
    )
    written = folder.with_name(f"{folder.name}_judgements.csv")
    write_csv(written, judgements.to_dict("records"))
    shown = {name: values[name] for name in dict.fromkeys((PAPER, best["measure"]))}
    draw(picture, setting.cases, best["arm"], areas[best["arm"]], shown)
    sys.stdout.write("".join(f"{path}\n" for path in (table, written, picture)))


def measure(setting: Setting, folder: Path, target: str, seed: int) -> list[dict[str, Any]]:
    """Measure the similarity of all sources to a target; `NAME seconds` is the processor time of each."""
    from studies.sources.measures import MEASURES

    rows = []
    for source in setting.cases:
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
def known(folder: Path, case: str, seed: int) -> Known:
    """Read a source's network, once a process."""
    from ship_trl.fast.worlds import make_env
    from ship_trl.policies.named import load_network
    from ship_trl.sim.cases import load_case, load_world, suite_of
    from studies.sources.measures import Known

    world = load_world()
    own = load_case(case, world, "source")
    path = weights_path(folder, case, seed)
    return Known(own, world, load_network(path, make_env(suite_of(own), world), "source_file"))


def read_measures(
    path: Path, cases: tuple[str, ...], seeds: int
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Read each measure, [seeds, targets, sources], larger for more similar, and its mean seconds.

    Raises:
        ConfigError: the table is not whole.
    """
    from studies.sources.measures import MEASURES

    places = ["target", "source", "seed"]
    wanted = {(t, s, str(seed)) for t in cases for s in cases if s != t for seed in range(seeds)}
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(places, str))
        found = list(table[places].itertuples(index=False, name=None))
        numbers = table[[*MEASURES, *(f"{name} seconds" for name in MEASURES)]].astype(float)
    except (KeyError, ValueError) as error:
        raise ConfigError(f"sources: {path} is no table of measures: {error}") from None
    if sorted(found) != sorted(wanted):
        raise ConfigError(f"sources: {path} does not fit the runs; delete it to measure again")
    at = tuple(pd.Index(cases).get_indexer(table[name]) for name in places[:2])
    values = {}
    for name, one in MEASURES.items():
        values[name] = np.full((seeds, len(cases), len(cases)), np.nan)
        values[name][table["seed"].astype(int), *at] = (-1 if one.nearer else 1) * numbers[name]
    return values, {name: float(numbers[f"{name} seconds"].mean()) for name in MEASURES}


def judge_all(
    values: Mapping[str, Floats], seconds: Mapping[str, float], judged: Mapping[str, Floats]
) -> pd.DataFrame:
    """Judge every measure, and what is fitted, on the arms that are judged: a row of each."""
    from studies.sources.measures import KINDS

    free = {name: value for name, value in values.items() if KINDS[name] != judge.ORACLE}
    found = []
    for arm, gains in judged.items():
        fitted = {"elsewhere": judge.elsewhere(gains), "regression": judge.regression(free, gains)}
        for name, value in {**values, **fitted}.items():
            row = {"measure": name, "kind": KINDS.get(name, judge.FITTED), "arm": arm}
            cells: dict[str, float] = {}
            for key, one in judge.judge(value, gains).items():
                cells |= one.cells(key, "_")
            cells["seconds"] = seconds.get(name, 0.0)
            found.append(row | {key: round(number, 4) for key, number in cells.items()})
    return pd.DataFrame(found)


def show_arms(gains: Gains, areas: Mapping[str, Floats], markdown: bool) -> None:
    """Print the mean gains of each arm, and how well seeds agree."""
    rows = []
    for arm, area in areas.items():
        one, both = judge.reliability(area)
        means = [judge.interval(np.nanmean(gains[arm, kind], axis=(0, 2))) for kind in OUTCOMES]
        best = judge.interval(np.nanmax(area.mean(0), axis=1)).value
        share = float(np.mean(area.mean(0)[np.isfinite(area[0])] > 0))
        kept = float(np.nanmean(gains[arm, judge.KEPT]))
        cells = [f"{share:.0%}", f"{best:+.3f}", f"{kept:.2f}", f"{one:.2f}", f"{both:.2f}"]
        rows.append([arm, *(one.words("+", 3) for one in means), *cells])
    kinds = [f"gain: {kind}" for kind in OUTCOMES]
    last = ("pairs that gain", "of the best source", "kept", "reliability of a seed", "of the mean")
    show(("arm", *kinds, *last), rows, markdown)


def estimate(row: Mapping[Any, float] | pd.Series, name: str) -> Estimate:
    """Return a mean of a judgement with its interval."""
    return Estimate(row[name], row[f"{name}_low"], row[f"{name}_high"])


def show_judgements(judgements: pd.DataFrame, markdown: bool) -> None:
    """Print a row for each measure, with the correlation, regret and hits of each arm."""
    rows = []
    for name, own in judgements.groupby("measure", sort=False):
        each = own.to_dict("records")
        cells = [estimate(one, "correlation").words("+") for one in each]
        cells += [f"{one['regret']:.3f}" for one in each] + [f"{one['top']:.0%}" for one in each]
        rows.append([str(name), each[0]["kind"], *cells, f"{each[0]['seconds']:.3f}"])
    arms = judgements["arm"].unique()
    groups = [f"{what}, {arm}" for what in ("correlation", "regret", "top 3") for arm in arms]
    show(("measure", "knows", *groups, "seconds"), rows, markdown)


def draw(path: Path, cases: Sequence[str], arm: str, gains: Floats, values: Mapping[str, Floats]) -> None:
    """Write a PNG: gains of all pairs, and measures of similarity as ranks within each target."""
    from matplotlib.figure import Figure

    from ship_trl.view.style import save_figure

    mean = gains.mean(0)
    panels = {f"gain of {arm} over scratch": mean}
    names = {PAPER: "equation 8"}
    panels |= {
        f"{names.get(name, name)}: rank of similarity": judge.shares(value) for name, value in values.items()
    }
    figure = Figure(figsize=(3.7 * len(panels), 4.2), dpi=100, layout="constrained")
    # Few enough names to be read where the picture is as wide as a page.
    named = range(0, len(cases), math.ceil(len(cases) / MAX_NAMES))
    names_of_cases = [cases[at] for at in named]
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
    save_figure(figure, path)
