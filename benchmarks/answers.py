"""`python -m benchmarks answers [numbers|pixels|both]`: what the runs of the second study say.

Judges the contrasts of docs/second-study.md, from the table of `python -m benchmarks questions` or the one
that was kept.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.gains import read_runs
from benchmarks.power import show_power
from benchmarks.questions import ARMS, FOLDER, FROZEN, PAIRS, SETTINGS, SIZES, TRAFFIC, plan_tasks
from benchmarks.runs import key
from benchmarks.similarity import run_table
from benchmarks.sources import IMAZU
from benchmarks.verdicts import (
    LEVEL,
    MARGIN,
    Contrast,
    Runs,
    Verdict,
    answers,
    is_asked,
    metric_of,
    read_study_runs,
)
from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import make_parser
from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.run.table import show
from ship_trl.study.report.tables import write_csv

BOTH = "both"
POLICIES = ("keep_course", "vo")
# What the table of levels has of each run, and its headings.
METRICS = {
    "area": "area",
    "start": "before training",
    "start_success": "success before training",
    "end": "end",
    "success": "success in training",
    "perturbed": "from drawn starts",
    "replayed": "its actions replayed",
    "traffic": "traffic_test",
}
# Colours of verdicts.
COLOURS = {
    Verdict.more: "#0072B2",
    Verdict.less: "#D55E00",
    Verdict.equal: "#009E73",
    Verdict.open: "#6b7280",
}


def main(arguments: list[str]) -> None:
    """Judge, print, and write a table and a picture."""
    parser = make_parser(
        "answers",
        f"{__doc__}\n\nWrites, of numbers and pixels:\n    {FOLDER}/SETTING_answers.csv and SETTING.png",
    )
    parser.prog = "python -m benchmarks answers"
    parser.add_argument(
        "setting",
        nargs="?",
        choices=(*SETTINGS, BOTH),
        help="what networks see; both: question 5; default: one after the other",
    )
    parser.add_argument(
        "--power", action="store_true", help="how often question 1 finds a gain, simulated before the runs"
    )
    parser.add_argument("--markdown", action="store_true", help="print Markdown tables")
    options = parser.parse_args(arguments)
    with refusals():
        run(options)


def run(options: Namespace) -> None:
    """Do what the options ask for."""
    if options.power:
        if options.setting not in SETTINGS:
            setting = options.setting or "no setting"
            raise ConfigError(f"answers: --power with {setting}; allowed: with numbers or pixels")
        show_power(options.setting, options.markdown)
        return
    settings = tuple(SETTINGS) if options.setting in (BOTH, None) else (options.setting,)
    runs = {setting: read_table(setting) for setting in settings}
    found = {setting: answers(read) for setting, read in runs.items()}
    for setting in settings if options.setting != BOTH else ():
        sys.stdout.write(f"From {setting}\n\n" if len(settings) > 1 else "")
        write(setting, runs[setting], found[setting], options.markdown)
    if len(settings) > 1:
        show_beside(found, options.markdown)


def write(setting: str, runs: Runs, found: list[Contrast], markdown: bool) -> None:
    """Print what was found of a setting; write a table and a picture."""
    show_contrasts(found, markdown)
    show_levels(runs, markdown)
    table = FOLDER / f"{setting}_answers.csv"
    write_csv(table, [asdict(one) for one in found])
    picture = FOLDER / f"{setting}.png"
    draw(picture, found)
    sys.stdout.write(f"{table}\n{picture}\n")


def read_table(setting: str) -> Runs:
    """Read the runs: those just made, or those that were kept.

    Raises:
        ConfigError: the table is no such table, or lacks runs.
    """
    path = run_table(FOLDER / setting)
    first = f"python -m benchmarks questions {setting}"
    if not path.is_file():
        raise ConfigError(f"answers: no runs in {path.with_suffix('')}; allowed: after {first}")
    made = read_runs(path)
    try:
        runs = read_study_runs(made)
    except KeyError as error:
        raise ConfigError(f"answers: {path} is no table of tested runs: it has no column {error}") from None
    except ValueError as error:
        raise ConfigError(f"answers: {path} is no table of tested runs: {error}") from None
    if len(made) > len(set(map(key, made))):
        raise ConfigError(f"answers: {path} has a run twice; allowed: once")
    wanted = {task.key(SETTINGS[setting]) for task in plan_tasks(SIZES[setting])}
    if missing := wanted - set(map(key, made)):
        raise ConfigError(f"answers: {len(missing)} runs are missing; allowed: after {first}")
    return runs


def show_contrasts(found: list[Contrast], markdown: bool) -> None:
    """Print a row for each contrast."""
    headings = (
        "question",
        "where",
        "contrast",
        "difference",
        "of possible gain",
        "runs",
        "p",
        "answer",
    )
    cells = [
        (
            str(one.question),
            one.where,
            one.what,
            f"{one.value:+.3f} ({one.low:+.3f} to {one.high:+.3f})",
            share_of(one),
            one.count,
            f"{one.p:.2g}",
            one.verdict.value,
        )
        for one in found
    ]
    show(headings, cells, markdown)


def show_beside(found: dict[str, list[Contrast]], markdown: bool) -> None:
    """Print what each observation says of questions 1 and 2, and their distance in standard errors."""
    asked = {
        setting: {
            (str(one.question), one.where, one.what): one for one in contrasts if one.question in (1, 2)
        }
        for setting, contrasts in found.items()
    }
    cells = []
    for name in next(iter(asked.values())):
        sides = [side[name] for side in asked.values()]
        told = [word for one in sides for word in (f"{one.value:+.3f}", share_of(one), one.verdict.value)]
        signs = {one.value > 0 for one in sides}
        apart = (sides[0].value - sides[1].value) / math.hypot(*map(standard_error, sides))
        cells.append((*name, *told, "yes" if len(signs) == 1 else "no", f"{apart:+.1f}"))
    headings = [word for name in asked for word in (f"from {name}", "of possible gain", "answer")]
    show(("question", "where", "contrast", *headings, "same sign", "apart"), cells, markdown)


def standard_error(one: Contrast) -> float:
    """Return about the standard error of a difference, from its 95 % interval."""
    return (one.high - one.low) / (2 * float(stats.norm.ppf(1 - LEVEL / 2)))


def share_of(one: Contrast) -> str:
    """Write the share of what could be gained, where that means something."""
    is_gain = np.isfinite(one.possible_gain) and one.question != 2
    return f"{one.value / one.possible_gain:.0%}" if is_gain else ""


def show_levels(runs: Runs, markdown: bool) -> None:
    """Print each arm's means and its success on unseen scenes, beside two policies."""
    cells = []
    traffic = [policy_success(name, None) for name in POLICIES]
    for where, pairs in places_of(runs).items():
        rows = [(SCRATCH.name, "")] + [(arm, "source") for arm in (*ARMS, FROZEN)] + [(FROZEN, "target")]
        for arm, kind in rows:
            groups = [(target, source_of(kind, source, target), arm, "") for target, source in pairs]
            if any(group not in runs for group in groups):
                continue
            levels = [[metric_of(runs, *group, metric=name).mean() for name in METRICS] for group in groups]
            means = np.mean(levels, axis=0)
            name = f"{arm} of the target" if kind == "target" else arm
            cells.append((where, name, *(f"{value:.2f}" for value in means)))
        for name, everywhere in zip(POLICIES, traffic, strict=True):
            share = np.mean([policy_success(name, target) for target, _ in pairs])
            blanks = ("",) * (len(METRICS) - 3)
            cells.append((where, name, *blanks, f"{share:.2f}", "", f"{everywhere:.2f}"))
    show(("where", "arm", *METRICS.values()), cells, markdown)


def places_of(runs: Runs) -> dict[str, list[tuple[str, str]]]:
    """Return targets and sources of the pairs, and of the Imazu problems if they were run."""
    places = {pair: [(target, source)] for pair, (source, target) in PAIRS.items()}
    if is_asked(runs, 3):
        places["imazu"] = [(target, TRAFFIC) for target in IMAZU]
    return places


def source_of(kind: str, source: str, target: str) -> str:
    """Return the source of a row: none, the pair's, or the target itself."""
    return {"": "", "source": source, "target": target}[kind]


@cache
def policy_success(name: str, target: str | None) -> float:
    """Return how often a policy reaches the goal from the drawn starts of a case; None: in `traffic_test`."""
    from tensordict import TensorDict
    from torch import Tensor

    from benchmarks.question_runs import STARTS, drawn_starts, traffic_starts
    from ship_trl.learn.lockstep import roll_out
    from ship_trl.policies.named import keep_course
    from ship_trl.policies.vo import vo
    from ship_trl.sim.cases import load_world
    from ship_trl.sim.env import ShipEnv
    from ship_trl.sim.suites import load_suite
    from ship_trl.sim.transition import make_step

    world = load_world()
    policy = {"keep_course": keep_course, "vo": vo}[name](ShipEnv(load_suite("1", world), world, 1))

    def choose(state: Tensor, _: int) -> Tensor:
        flat = state.flatten(0, 1)
        acted = policy(TensorDict({"state": flat}, batch_size=[len(flat)]))
        return acted["action"].view(state.shape[:2])

    begin = traffic_starts(world) if target is None else drawn_starts(target, STARTS)
    return float(roll_out(make_step(world), begin[None], choose)[1].float().mean())


def draw(path: Path, found: list[Contrast]) -> None:
    """Write a PNG: each arm's gain as a share of the possible gain, a panel for each pair."""
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
            low, value, high = (number / one.possible_gain for number in (one.low, one.value, one.high))
            axes.plot((low, high), (row, row), color=COLOURS[one.verdict], linewidth=2)
            axes.plot(value, row, "o", color=COLOURS[one.verdict], markersize=6)
        axes.set_yticks(range(len(own)), [one.what.removesuffix(" less scratch") for one in own], fontsize=10)
        axes.set_ylim(len(own) - 0.5, -0.5)
        axes.set_title(where, fontsize=11, loc="left")
        axes.tick_params(axis="x", labelsize=9)
    handles = [
        panels[0].plot([], [], "o-", color=colour, label=verdict.value)[0]
        for verdict, colour in COLOURS.items()
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), fontsize=9, frameon=False)
    figure.supxlabel(
        "gain in greedy area over scratch, as a share of what could be gained; grey band: the margin;\n"
        "95 % intervals are not adjusted, answers are",
        fontsize=10,
    )
    save(figure, path)
