"""`python -m ship_trl results [FOLDER...]`: list the finished runs below folders in a table. No torch.

A row holds runs that differ only in their seeds; settings that tell rows apart are part of the name. With
NAME=FILE in place of folders, as `results scratch='logs/a/*/monitor.csv' FT3='logs/b/*/monitor.csv'`, metrics
of transfer are shown from logs of any library; their help: results NAME=FILE --help.
"""

from __future__ import annotations

import glob
import re
import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator
from math import floor
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, make_parser
from ship_trl.config.bounds import PositiveShare
from ship_trl.config.errors import ConfigError, command, print_error
from ship_trl.config.paths import stem
from ship_trl.files.curve import RunError
from ship_trl.files.logs import KINDS, LearningCurve, read_logs
from ship_trl.files.record import Evaluation, RunRecord
from ship_trl.run.console import show
from ship_trl.run.results import collect, drop_copies, group_runs
from ship_trl.sim.cases import describe
from ship_trl.study import metrics

# A column of transfers: returns on the source of its own network, and of the run's at the end.
SOURCE_HEADING = "return on the source, its network > at the end, by seed"
HEADINGS = (
    *("run", "runs", "seeds", "best known", "best greedy return", "best by seed", "of best known"),
    *("best at goal", "final return", "final by seed", "final at goal", SOURCE_HEADING),
)
# What is shown of them unless all are asked for: of several runs medians, with the least and the greatest.
SHORT = ("run", "runs", "best greedy return", "final return", "final at goal")
TEST_HEADINGS = ("run", "mean greedy return of a run, one folder", "the other", "p, permutation")


def main(arguments: list[str] | None = None) -> None:
    """Print a row for each arm of a pair, folder and settings, and what else the options ask for."""
    given = sys.argv[2:] if arguments is None else arguments
    # A path may contain an equals sign, for example seed=0.
    if any(re.match(r"(?!-)[^/=]*=", word) and not Path(word).exists() for word in given):
        measure_logs(given)
        return
    parser = make_parser("results", __doc__)
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="default: outputs")
    parser.add_argument("--arm", help="only this arm, as scratch or FT3")
    parser.add_argument("--all", action="store_true", help="show every column, and returns by seed")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    add_output(parser, "--picture", (".png",), "draw the learning curves beside each other")
    parser.add_argument("--test", action="store_true", help="test whether runs of two folders learn alike")
    parser.add_argument("--transfer", action="store_true", help="show the usual metrics of transfer")
    parser.add_argument("--stability", action="store_true", help="count falls and show the spread over seeds")
    add_output(parser, "--csv", (".csv",), "write every number of every run, a row each")
    options = parser.parse_args(arguments)
    folders = options.folders or [Path("outputs")]
    with refusals():
        if options.test and len(folders) != 2:
            raise ConfigError(f"--test: two folders are needed, got {len(folders)}")
        found = finished_runs(folders, options.arm)
        if options.picture is not None:
            picture(options.picture, found)
        show(HEADINGS, summarise(found), options.markdown, shown=HEADINGS if options.all else SHORT)
        if options.csv is not None or options.stability:
            from ship_trl.study.report import tables

            measured = list(tables.measure_runs(group_runs(found)))
            if options.csv is not None:
                tables.write_csv(options.csv, measured)
            if options.stability:
                show(tables.STABILITY_HEADINGS, tables.stability_rows(measured), options.markdown)
        if options.transfer:
            from ship_trl.study.report import tables

            show(tables.TRANSFER_HEADINGS, tables.rows_of_transfer(group_runs(found)), options.markdown)
            sys.stdout.write(tables.describe_scales(found))
        if options.test:
            show(TEST_HEADINGS, compare(found, *folders), options.markdown)
        for path in filter(None, (options.picture, options.csv)):
            sys.stdout.write(f"{path}\n")


def finished_runs(folders: list[Path], arm: str | None) -> list[RunRecord]:
    """Find the runs in folders and below, at least one; name those that cannot be read on stderr."""
    found = [one for folder in folders for one in drop_copies(collect(folder)) if arm in (None, one.arm)]
    if found:
        return found
    from ship_trl.study.tables import has_tables

    for folder in filter(has_tables, folders):
        raise ConfigError(
            f"folder: {folder} holds a study's tables; {command('study', 'report', folder)} reads them"
        )
    places = ", ".join(map(str, folders))
    raise ConfigError(f"folder: no finished run below {places}; python -m ship_trl makes one")


def summarise(found: Iterable[RunRecord]) -> Iterable[list[str]]:
    """Make the cells of `HEADINGS` for each group of runs that differ only in their seeds."""
    for name, runs in group_runs(found).items():
        known = runs[0].best_known_return
        best, final = [one.best for one in runs], [one.final for one in runs]
        lowest = min(score.episode_return for score in best)
        # Rounded down, so that less than the best known return is never called 100 %.
        share = "-"
        if known is not None and min(known, lowest) > 0:
            share = f"{'at least ' if len(runs) > 1 else ''}{floor(100 * lowest / known)}%"
        yield [
            name,
            str(len(runs)),
            " ".join(str(one.seed) for one in runs),
            "-" if known is None else f"{known:.1f}",
            *describe_returns(best),
            share,
            goals(best),
            *describe_returns(final),
            goals(final),
            kept(runs),
        ]


def describe_returns(scores: list[Evaluation]) -> tuple[str, str]:
    """Return the median of returns with the least and the greatest, and all in their order."""
    returns = [score.episode_return for score in scores]
    between = f" ({min(returns):.1f} to {max(returns):.1f})" if len(returns) > 1 else ""
    return f"{np.median(returns):.1f}{between}", " ".join(f"{one:.1f}" for one in returns)


def kept(runs: Iterable[RunRecord]) -> str:
    """Name the returns on the source of its own network and of the run's at the end; - without a source."""
    sources = [one.on_source for one in runs]
    return ", ".join("-" if one is None else f"{one.network:.1f} > {one.final:.1f}" for one in sources)


def goals(scores: list[Evaluation]) -> str:
    """Count the greedy episodes that end at the goal."""
    reached = sum(round(score.success_rate * score.episodes) for score in scores)
    return f"{reached} of {sum(score.episodes for score in scores)}"


def with_curves(found: Iterable[RunRecord]) -> Iterator[RunRecord]:
    """Yield runs whose curves can be read; name the others on stderr."""
    for run in found:
        try:
            run.curve  # noqa: B018
        except RunError as error:
            print_error(f"{run.folder}: {error}; left out")
        else:
            yield run


def compare(found: list[RunRecord], one: Path, other: Path) -> Iterable[list[str]]:
    """Make a row for each arm of a pair: the runs' mean greedy returns in both folders, and the p-value."""
    from ship_trl.study.statistics import permutation

    means: dict[str, dict[Path, list[float]]] = {}
    for run in with_curves(sorted(found, key=lambda run: run.seed)):
        by_folder = means.setdefault(f"{run.label} {run.name}", {one: [], other: []})
        by_folder[run.below].append(float(run.greedy.returns.mean()))
    for name, by_folder in sorted(means.items()):
        samples = [np.array(by_folder[folder]) for folder in (one, other)]
        enough = min(map(len, samples)) > 1
        p = f"{permutation(samples[0], samples[1], seed=0):.2f}" if enough else "-"
        yield [name, *(" ".join(f"{mean:.1f}" for mean in sample) for sample in samples), p]


def picture(path: Path, found: list[RunRecord]) -> None:
    """Draw learning curves: a panel for each pair, a line for each arm and folder."""
    from ship_trl.view.charts import draw_comparison

    several = len({one.below for one in found}) > 1
    panels: dict[str, dict[str, list[RunRecord]]] = {}
    for one in with_curves(found):
        name = f"{one.below}: {one.name}" if several else one.name
        title = describe(one.pair) if one.pair == stem(one.target) else f"pair {one.pair}"
        title = f"{one.part}: {title}" if one.part else title
        panels.setdefault(title, {}).setdefault(name, []).append(one)
    if not panels:
        raise ConfigError("picture: no learning curve to draw")
    draw_comparison(path, panels)


LOGS = """\
Metrics of transfer from learning curves of any library:

    python -m ship_trl results scratch='logs/scratch/*/monitor.csv' FT3='logs/ft3/*/monitor.csv'
    python -m ship_trl results scratch='outputs/high/scratch/*/curve.csv' FT3='outputs/high/FT3/*/curve.csv'

FILE is Stable-Baselines3's monitor.csv, progress.csv or evaluations.npz, TensorBoard's event file or exported
scalars, a curve.csv of ours, or a table with columns step, return and, for several runs, seed. Steps are
environment steps of all workers. A FILE with * names several files, with ** in folders at any depth; each is
a run, but 0.monitor.csv, 1.monitor.csv and so on in one folder are workers of one run, and event files in one
folder are one resumed run. A run must begin near step 0. The first arm is the baseline. Returns are scaled to
scores from --low to --high, by default random actions and the best known plan (runs of ours say both), else
the extremes of all runs. Less time and forgetting are better; the other metrics are better when larger.
"""
Return = Annotated[float, Field(ge=-1e9, le=1e9)]
# In the steps that all runs have.
MIN_RETURNS = 10
# A first return holds for the steps before it. They may be this share of the steps, or two of the run's gaps.
MAX_BEGINNING = 0.1


def measure_logs(arguments: list[str]) -> None:
    """Print a row for each arm, and one for its difference from the baseline."""
    parser = make_parser("results", LOGS)
    parser.add_argument(
        "arms", nargs="+", metavar="NAME=FILE", help="logs of an arm; the first is the baseline"
    )
    add_number(parser, "--low", Return, None, "return that scores 0")
    add_number(parser, "--high", Return, None, "return that scores 1")
    add_number(parser, "--threshold", PositiveShare, metrics.THRESHOLDS[0], "score to reach; default: 0.65")
    add_output(parser, "--csv", (".csv",), "metrics of every run, a row each")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_args(arguments)
    with refusals():
        show_transfers(read_arms(options.arms), options)


def read_arms(words: list[str]) -> dict[str, list[LearningCurve]]:
    """Read the curves of each arm.

    Raises:
        ConfigError: a word is not NAME=FILE, or a file cannot be used.
    """
    arms: dict[str, list[Path]] = {}
    read: set[Path] = set()
    for word in words:
        name, equals, pattern = word.partition("=")
        if not name or not equals:
            raise ConfigError(f"results: allowed: NAME=FILE, got {word}; FILE: {KINDS}")
        # Path.glob takes no absolute pattern.
        is_pattern = glob.has_magic(pattern) and not Path(pattern).is_file()
        paths = sorted(glob.glob(pattern, recursive=True)) if is_pattern else [pattern]  # noqa: PTH207
        if not paths:
            raise ConfigError(f"{name}: no file {pattern}; allowed: {KINDS}")
        for path in paths:
            # One file may be spelled in several ways.
            if Path(path).resolve() in read:
                raise ConfigError(f"{name}: {path} is given twice; allowed: each run once")
            read.add(Path(path).resolve())
            arms.setdefault(name, []).append(Path(path))
    return {name: read_logs(paths, name) for name, paths in arms.items()}


def show_transfers(arms: dict[str, list[LearningCurve]], options: Namespace) -> None:
    """Measure the arms, and print and write what was found."""
    import pandas as pd

    from ship_trl.study.compare import forward_transfer
    from ship_trl.study.report.tables import write_csv
    from ship_trl.study.statistics import welch

    curves = [curve for own in arms.values() for curve in own]
    steps = min(float(curve.steps[-1]) for curve in curves)
    check_steps(arms, steps)
    moving = {name: metrics.moving_returns(own, steps) for name, own in arms.items()}
    low, high = metrics.find_scale(curves, np.concatenate([*moving.values()]))
    low = low if options.low is None else options.low
    high = high if options.high is None else options.high
    if not high > low:
        raise ConfigError(
            f"--low: must be below --high, got {low:g} and {high:g}; the returns reach both by default"
        )
    found = {
        name: metrics.measure_curves(own, (moving[name] - low) / (high - low), options.threshold)
        for name, own in arms.items()
    }
    table = pd.concat({name: pd.DataFrame(values) for name, values in found.items()}, names=["arm"])
    table = table.dropna(axis=1, how="all")
    baseline, rows = next(iter(arms)), []
    for name in arms:
        own, base = ({key: table.loc[one, key].to_numpy() for key in table} for one in (name, baseline))
        cells = [welch(float(one.mean()), [one]).words() for one in own.values()]
        rows.append([name, str(len(arms[name])), *cells, ""])
        if name != baseline:
            pairs = [(one, base[key]) for key, one in own.items()]
            cells = [welch(float(a.mean() - b.mean()), [a, b]).words("+") for a, b in pairs]
            forward = forward_transfer(own["area"], base["area"])
            rows.append([f"{name} - {baseline}", "", *cells, forward.words("+")])
    show(("arm", "runs", *table, "forward transfer"), rows, options.markdown)
    sys.stdout.write(
        f"scores: 0 is a return of {low:g}, 1 is {high:g}; areas over the first {steps:,.0f} steps; time: "
        f"share of them until a score of {options.threshold:g}; 95 % intervals over runs\n"
    )
    if options.csv is not None:
        table.insert(0, "run", [curve.name for curve in curves])
        write_csv(options.csv, table.reset_index("arm").to_dict("records"))
        sys.stdout.write(f"{options.csv}\n")


def check_steps(arms: dict[str, list[LearningCurve]], steps: float) -> None:
    """Check that every run has returns in the steps that all runs have, from near their beginning on.

    Raises:
        ConfigError: a run has too few, begins later, or has no steps.
    """
    for name, curves in arms.items():
        for curve in curves:
            if sum(curve.steps <= steps) < MIN_RETURNS or not steps > 0:
                where = f"the first {steps:,.0f} steps, which are those that all runs have"
                allowed = "runs of like lengths that begin at step 0"
                raise ConfigError(
                    f"{name}: {curve.name} has fewer than {MIN_RETURNS} returns in {where}; "
                    f"allowed: {allowed}"
                )
            if curve.steps[0] > max(MAX_BEGINNING * steps, 2 * np.diff(curve.steps).max()):
                raise ConfigError(
                    f"{name}: {curve.name} begins at step {curve.steps[0]:,.0f} of the {steps:,.0f} that all "
                    "runs have; allowed: runs from step 0 on, with the file before if it was resumed"
                )
