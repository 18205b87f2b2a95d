"""`python -m ship_trl results scratch=FILE... FT3=FILE...`: metrics of transfer from curves of any library.

    python -m ship_trl results scratch='logs/scratch/*/monitor.csv' FT3='logs/ft3/*/monitor.csv'
    python -m ship_trl results scratch='outputs/high/scratch/*/curve.csv' FT3='outputs/high/FT3/*/curve.csv'

FILE is Stable-Baselines3's monitor.csv or progress.csv, TensorBoard's event file or exported scalars, a
curve.csv of ours, or a table with columns step, return and, for several runs, seed. Steps are environment
steps of all workers. A FILE with * names several files, with ** in folders at any depth; each is a run, but
0.monitor.csv, 1.monitor.csv and so on in one folder are workers of one run, and event files in one folder are
one resumed run. A run must begin near step 0. The first arm is the baseline. Returns are scaled to scores
from --low to --high, by default random actions and the best known plan (runs of ours say both), else the
extremes of all runs. Less time and forgetting are better; the other metrics are better when larger.
"""

from __future__ import annotations

import glob
import sys
from argparse import Namespace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, make_parser
from ship_trl.config.bounds import PositiveShare
from ship_trl.config.errors import ConfigError
from ship_trl.files.logs import KINDS, LearningCurve, read_logs
from ship_trl.run.console import show

Return = Annotated[float, Field(ge=-1e9, le=1e9)]
# In the steps that all runs have.
MIN_RETURNS = 10
# A first return holds for the steps before it. They may be this share of the steps, or two of the run's gaps.
MAX_BEGINNING = 0.1


def main(arguments: list[str] | None = None) -> None:
    """Print a row for each arm, and one for its difference from the baseline."""
    parser = make_parser("results", __doc__)
    parser.add_argument(
        "arms", nargs="+", metavar="NAME=FILE", help="logs of an arm; the first is the baseline"
    )
    add_number(parser, "--low", Return, None, "return that scores 0")
    add_number(parser, "--high", Return, None, "return that scores 1")
    add_number(parser, "--threshold", PositiveShare, None, "score to reach; default: 0.65")
    add_output(parser, "--csv", (".csv",), "metrics of every run, a row each")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    options = parser.parse_args(arguments)
    with refusals():
        report(read_arms(options.arms), options)


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


def report(arms: dict[str, list[LearningCurve]], options: Namespace) -> None:
    """Measure the arms, and print and write what was found."""
    from ship_trl.study import metrics
    from ship_trl.study.compare import forward_transfer
    from ship_trl.study.statistics import welch

    steps = min(float(curve.steps[-1]) for curves in arms.values() for curve in curves)
    check_steps(arms, steps)
    found = metrics.find_scale(arms, steps)
    low = found.low if options.low is None else options.low
    high = found.high if options.high is None else options.high
    if not high > low:
        raise ConfigError(
            f"--low: must be below --high, got {low:g} and {high:g}; the returns reach both by default"
        )
    scale = metrics.Scale(low, high, options.threshold or found.threshold)
    measured = metrics.measure_arms(arms, steps, scale)
    (baseline, base), rows = next(iter(measured.items())), []
    for name, values in measured.items():
        cells = [welch(float(one.mean()), [one]).words() for one in values.values()]
        rows.append([name, str(len(arms[name])), *cells, ""])
        if name != baseline:
            pairs = [(one, base[key]) for key, one in values.items()]
            cells = [welch(float(a.mean() - b.mean()), [a, b]).words("+") for a, b in pairs]
            forward = forward_transfer(values["area"], base["area"])
            rows.append([f"{name} - {baseline}", "", *cells, forward.words("+")])
    show(("arm", "runs", *base, "forward transfer"), rows, options.markdown)
    sys.stdout.write(
        f"scores: 0 is a return of {low:g}, 1 is {high:g}; areas over the first {steps:,.0f} steps; time: "
        f"share of them until a score of {scale.threshold:g}; 95 % intervals over runs\n"
    )
    if options.csv is not None:
        from ship_trl.study.report.tables import write_csv

        each = [
            {"arm": name, "run": curve.name} | {key: float(one[k]) for key, one in measured[name].items()}
            for name, curves in arms.items()
            for k, curve in enumerate(curves)
        ]
        write_csv(options.csv, each)
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
