"""`python -m ship_trl results`: a table of the finished runs below a folder. No torch."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, make_parser
from ship_trl.cli.table import show
from ship_trl.config.errors import print_error
from ship_trl.files.curve import CurveError, read_curve, split
from ship_trl.files.result import Evaluation
from ship_trl.run.results import Found, collect, drop_copies, folders_of, group_runs

if TYPE_CHECKING:
    import pandas as pd

HEADINGS = (
    "run",
    "seeds",
    "best known",
    "best greedy return by seed",
    "share",
    "goal",
    "final by seed",
    "goal",
)
TEST_HEADINGS = ("run", "mean greedy return of a run, one folder", "the other", "p, permutation")


def main(arguments: list[str] | None = None) -> None:
    """Read the `result.json` of every run and print one row for each arm of a pair and folder."""
    parser = make_parser("results", __doc__)
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="default: outputs")
    parser.add_argument("--arm", help="only this arm, as scratch or FT3")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    add_output(parser, "--picture", (".png",), "draw the learning curves beside each other")
    parser.add_argument("--test", action="store_true", help="test whether runs of two folders learn alike")
    parser.add_argument(
        "--stability", action="store_true", help="how often runs fall back, and how they spread"
    )
    add_output(parser, "--csv", (".csv",), "write every number of every run, a row each")
    options = parser.parse_args(arguments)
    folders = options.folders or [Path("outputs")]
    found: list[Found] = []
    for folder in folders:
        whole, broken = collect(folder)
        for path, error in broken:
            print_error(f"{path} {error}; left out")
        found += [one for one in drop_copies(whole) if options.arm in (None, one.result.arm)]
    if not found:
        print_error(nothing_below(folders))
        sys.exit(1)
    from ship_trl.study.analysis import stability
    from ship_trl.study.report.tables import write_csv

    with refusals():
        if options.picture is not None:
            picture(options.picture, found)
        if options.csv is not None:
            write_csv(options.csv, list(stability.numbers(folders_of(found))))
    show(HEADINGS, summarise(found), options.markdown)
    if options.stability:
        show(stability.HEADINGS, stability.rows(folders_of(found)), options.markdown)
    if options.test:
        if len(folders) != 2:
            print_error(f"--test: two folders are needed, got {len(folders)}")
            sys.exit(1)
        show(TEST_HEADINGS, compare(found, *folders), options.markdown)


def nothing_below(folders: list[Path]) -> str:
    """Say that no run is there, and what to do about it."""
    from ship_trl.study.records.tables import has_tables

    for folder in folders:
        if has_tables(folder):
            return f"folder: {folder} holds a study's tables; python -m ship_trl report {folder} reads them"
    return f"folder: no finished run below {', '.join(map(str, folders))}; python -m ship_trl makes one"


def summarise(found: Iterable[Found]) -> Iterable[list[str]]:
    """Make one row for each part, profile, pair and arm."""
    for name, runs in group_runs(found).items():
        known = runs[0].result.best_known_return
        best, final = [one.result.best for one in runs], [one.result.final for one in runs]
        lowest = min(score.episode_return for score in best)
        # Rounded down, so that less than the best known return is never called 100 %.
        share = f"{'at least ' if len(runs) > 1 else ''}{floor(100 * lowest / known)}%" if known > 0 else "-"
        yield [
            name,
            " ".join(str(one.result.seed) for one in runs),
            f"{known:.1f}",
            " ".join(f"{score.episode_return:.1f}" for score in best),
            share if lowest > 0 else "-",
            goals(best),
            " ".join(f"{score.episode_return:.1f}" for score in final),
            goals(final),
        ]


def split_curve(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """Read a run's training episodes and greedy evaluations; None, and said, if its curve is not whole."""
    try:
        return split(read_curve(folder))
    except CurveError as error:
        print_error(f"{folder}: {error}; left out")
        return None


def compare(found: list[Found], one: Path, other: Path) -> Iterable[list[str]]:
    """For each arm of a pair: the runs' mean greedy returns in both folders, and p of their being alike."""
    from ship_trl.study.analysis.statistics import permutation

    means: dict[tuple[str, str], dict[Path, list[float]]] = {}
    for run in sorted(found, key=lambda run: run.result.seed):
        curve = split_curve(run.folder)
        if curve is not None:
            by_folder = means.setdefault((run.place, run.result.arm), {one: [], other: []})
            by_folder[run.below].append(float(np.mean(curve[1]["return"].to_numpy())))
    for (pair, arm), both in sorted(means.items()):
        samples = [np.array(both[folder]) for folder in (one, other)]
        enough = min(map(len, samples)) > 1
        p = f"{permutation(samples[0], samples[1], seed=0):.2f}" if enough else "-"
        yield [f"{pair} {arm}", *(" ".join(f"{mean:.1f}" for mean in sample) for sample in samples), p]


def picture(path: Path, found: list[Found]) -> None:
    """Draw learning curves: a column for each pair, a line for each arm and folder."""
    from ship_trl.view.curves import Curve, draw_comparison

    several = len({one.below for one in found}) > 1
    panels: dict[str, dict[str, list[Curve]]] = {}
    for one in found:
        read = split_curve(one.folder)
        if read is None:
            continue
        training, greedy = read
        columns = training["return"], greedy["episode"], greedy["return"]
        curve = Curve(*(column.to_numpy() for column in columns))
        name = f"{one.below}: {one.result.arm}" if several else one.result.arm
        panels.setdefault(one.place, {}).setdefault(name, []).append(curve)
    if not panels:
        print_error("picture: no learning curve to draw")
        sys.exit(1)
    draw_comparison(path, panels, {one.place: one.result.best_known_return for one in found})


def goals(scores: list[Evaluation]) -> str:
    """Count the greedy episodes that end at the goal."""
    return f"{sum(score.outcome == 'goal' for score in scores)} of {len(scores)}"
