"""`python -m benchmarks answers numbers|pixels`: what the runs of the second study say.

Judges the contrasts of docs/second-study.md, from the table of `python -m benchmarks questions` or the one
that was kept.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.questions import ARMS, FOLDER, PAIRS, SETTINGS, SIZES, TRAFFIC
from benchmarks.sources import FOLDER as BENCHMARK
from benchmarks.sources import IMAZU
from benchmarks.verdicts import (
    LEVEL,
    MARGIN,
    Contrast,
    Runs,
    Sample,
    Verdict,
    answers,
    of,
    read_study_runs,
)
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.cli.table import show
from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.sources.gains import read_outcome, read_runs
from ship_trl.study.report.tables import write_csv

DRAWS, SEED = 2000, 2022
# Colours of verdicts.
COLOURS = {
    Verdict.more: "#0072B2",
    Verdict.less: "#D55E00",
    Verdict.equal: "#009E73",
    Verdict.open: "#6b7280",
}


def main(arguments: list[str]) -> None:
    """Judge, print, and write a table and a picture."""
    parser = make_parser("answers", f"{__doc__}\n\nWrites:\n    {FOLDER}/SETTING_answers.csv and SETTING.png")
    parser.prog = "python -m benchmarks answers"
    parser.add_argument("setting", choices=SETTINGS, help="what networks see")
    parser.add_argument(
        "--power", action="store_true", help="how often question 1 finds a gain, simulated; no runs are read"
    )
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    with refusals():
        if options.power:
            show_power(options.setting, options.markdown)
        else:
            run(options)


def run(options: Namespace) -> None:
    """Judge all questions."""
    runs = read_table(FOLDER / options.setting)
    found = answers(runs)
    show_contrasts(found, options.markdown)
    show_elsewhere(runs, options.markdown)
    table = FOLDER / f"{options.setting}_answers.csv"
    write_csv(table, [asdict(one) for one in found])
    picture = FOLDER / f"{options.setting}.png"
    draw(picture, found)
    sys.stdout.write(f"{table}\n{picture}\n")


def read_table(folder: Path) -> Runs:
    """Read the runs: those just made, or those that were kept."""
    made = folder.with_suffix(".csv")
    path = made if made.is_file() else folder.with_suffix(".csv.xz")
    try:
        return read_study_runs(read_runs(path))
    except (KeyError, ValueError) as error:
        raise ConfigError(f"questions: {path} is not a table of tested runs: {error}") from None


def show_contrasts(found: list[Contrast], markdown: bool) -> None:
    """Print a row for each contrast."""
    headings = ("question", "where", "contrast", "difference", "of what could be", "runs", "p", "says")
    cells = [
        (
            str(one.question),
            one.where,
            one.what,
            f"{one.value:+.3f} ({one.low:+.3f} to {one.high:+.3f})",
            "" if np.isnan(one.could) else f"{one.value / one.could:.0%}",
            one.count,
            f"{one.p:.2g}",
            one.verdict.value,
        )
        for one in found
    ]
    show(headings, cells, markdown)


def show_elsewhere(runs: Runs, markdown: bool) -> None:
    """Print how often networks reach the goal on scenes that they did not see, beside two policies."""
    places = [(pair, [(target, source)]) for pair, (source, target) in PAIRS.items()]
    if any(source == TRAFFIC for _, source, _, _ in runs):
        places.append(("imazu", [(target, TRAFFIC) for target in IMAZU]))
    cells = []
    for where, pairs in places:
        for arm in (SCRATCH.name, *ARMS):
            sources = [(target, "" if arm == SCRATCH.name else source) for target, source in pairs]
            means = [
                [of(runs, target, source, arm, metric).mean() for metric in METRICS]
                for target, source in sources
                if (target, source, arm, "") in runs
            ]
            if means:
                cells.append((where, arm, *(f"{value:.2f}" for value in np.mean(means, axis=0))))
        cells += [(where, *row) for row in policies([target for target, _ in pairs])]
    show(("where", "arm", *(METRICS.values())), cells, markdown)


METRICS = {
    "area": "area",
    "start": "score before training",
    "end": "end",
    "success": "success in training",
    "perturbed": "from drawn starts",
    "replayed": "its actions replayed",
    "traffic": "traffic_test",
}


def policies(targets: list[str]) -> list[tuple[str, ...]]:
    """Return the success of keeping the course and of velocity obstacles, as rows of the table."""
    from tensordict import TensorDict
    from torch import Tensor

    from benchmarks.question_runs import drawn_starts
    from ship_trl.learn.lockstep import roll_out
    from ship_trl.policies.named import keep_course
    from ship_trl.policies.vo import vo
    from ship_trl.sim.cases import load_world
    from ship_trl.sim.env import ShipEnv
    from ship_trl.sim.suites import load_suite
    from ship_trl.sim.transition import make_step

    world, found = load_world(), list[tuple[str, ...]]()
    env = ShipEnv(load_suite(targets[0], world), world, 1)
    step = make_step(world)
    for name, make in (("keep_course", keep_course), ("vo", vo)):
        shares = []
        for target in targets:
            policy = make(env)

            def choose(state: Tensor, _: int) -> Tensor:
                flat = state.flatten(0, 1)
                acted = policy(TensorDict({"state": flat}, batch_size=[len(flat)]))  # noqa: B023
                return acted["action"].view(state.shape[:2])

            shares.append(float(roll_out(step, drawn_starts(target)[None], choose)[1].float().mean()))
        found.append((name, "", "", "", "", f"{np.mean(shares):.2f}", "", ""))
    return found


def draw(path: Path, found: list[Contrast]) -> None:
    """Write a PNG: gains over scratch as shares of what could be gained, a panel for each pair."""
    from matplotlib.figure import Figure

    from ship_trl.view.chart import save

    shown = [one for one in found if one.question in (1, 3) and one.what.endswith("less scratch")]
    wheres = list(dict.fromkeys(one.where for one in shown))
    figure = Figure(figsize=(3.2 * len(wheres), 3.4), dpi=110, layout="constrained")
    panels = figure.subplots(1, len(wheres), sharex=True, squeeze=False)[0]
    for axes, where in zip(panels, wheres, strict=True):
        own = [one for one in shown if one.where == where]
        axes.axvspan(-MARGIN, MARGIN, color="#eef0f3", zorder=0)
        for at in (0.0, 1.0):
            axes.axvline(at, color="#6b7280", linewidth=0.8)
        for row, one in enumerate(own):
            low, value, high = (number / one.could for number in (one.low, one.value, one.high))
            axes.plot((low, high), (row, row), color=COLOURS[one.verdict], linewidth=2)
            axes.plot(value, row, "o", color=COLOURS[one.verdict], markersize=6)
        axes.set_yticks(range(len(own)), [one.what.removesuffix(" less scratch") for one in own], fontsize=10)
        axes.set_ylim(len(own) - 0.5, -0.5)
        axes.set_title(where, fontsize=11, loc="left")
        axes.tick_params(axis="x", labelsize=9)
    figure.supxlabel("gain in greedy area over scratch, as a share of what could be gained", fontsize=10)
    save(figure, path)


def show_power(setting: str, markdown: bool) -> None:
    """Print how often a contrast of question 1 is found, after Bonferroni's correction.

    Samples are drawn from the residuals of the benchmark's runs: from scratch, and of its arms.
    """
    sizes, generator = SIZES[setting], np.random.default_rng(SEED)
    kept = read_runs(BENCHMARK / f"{setting}.csv.xz")
    level = LEVEL / (len(PAIRS) * (len(ARMS) + 2))
    cells = []
    for pair, (source, target) in PAIRS.items():
        areas = residuals(kept, target, "", SCRATCH.name)
        could = 1 - float(np.mean(areas[0]))
        for arm in dict.fromkeys(row["arm"] for row in kept if row["source"]):
            _, spread = residuals(kept, target, source, arm)
            powers = [
                power(areas[1], spread, share * could, (sizes.scratch, sizes.arm), level, generator)
                for share in (0.0, MARGIN, 0.5)
            ]
            cells.append((pair, arm, f"{could:.2f}", *(f"{one:.2f}" for one in powers)))
    show(("pair", "arm", "could be gained", "nothing", "the margin", "half of it"), cells, markdown)


def residuals(kept: list[dict[str, str]], target: str, source: str, arm: str) -> tuple[Sample, Sample]:
    """Return areas of the benchmark's runs, and their residuals, as large as those of a sample."""
    length = min(int(row["length"]) for row in kept)
    areas = np.array(
        [
            read_outcome(row).area
            for row in kept
            if (row["target"], row["source"], row["arm"], int(row["length"])) == (target, source, arm, length)
        ]
    )
    return areas, (areas - areas.mean()) * np.sqrt(len(areas) / (len(areas) - 1))


def power(
    base: Sample,
    spread: Sample,
    gain: float,
    sizes: tuple[int, int],
    level: float,
    generator: np.random.Generator,
) -> float:
    """Return the share of simulated studies whose Welch test finds the gain."""
    one = generator.choice(spread, (DRAWS, sizes[1])) + gain
    other = generator.choice(base, (DRAWS, sizes[0]))
    found = stats.ttest_ind(one, other, axis=1, equal_var=False)
    return float(np.mean((found.pvalue <= level) & ((found.statistic > 0) | (gain == 0.0))))
