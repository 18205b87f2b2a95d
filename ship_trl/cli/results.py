"""`python -m ship_trl results [FOLDER...]`: list the finished runs below folders in a table. No torch.

A row holds runs that differ only in their seeds; settings that tell rows apart are part of the name. With
NAME=FILE in place of folders, as `results scratch='logs/a/*/monitor.csv' FT3='logs/b/*/monitor.csv'`, metrics
of transfer are shown from logs of any library; their help: results NAME=FILE --help.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from math import floor
from pathlib import Path

import numpy as np

from ship_trl.cli import metrics
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, make_parser
from ship_trl.config.command import command
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.files.curve import RunError
from ship_trl.files.record import Evaluation, RunRecord
from ship_trl.run.console import show
from ship_trl.run.results import collect, drop_copies, group_runs

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
        metrics.main(given)
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
    found: list[RunRecord] = []
    for folder in folders:
        whole, broken = collect(folder)
        for path, error in broken:
            print_error(f"{path}: {error}; left out")
        found += [one for one in drop_copies(whole) if arm in (None, one.arm)]
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
        panels.setdefault(one.label, {}).setdefault(name, []).append(one)
    if not panels:
        raise ConfigError("picture: no learning curve to draw")
    draw_comparison(path, panels)
