"""Judge the contrasts of the second study: print, and write a table and a picture."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

import numpy as np
from scipy import stats

from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.run.console import show
from ship_trl.study.report.tables import write_csv
from studies.runs import read_runs
from studies.second.answers import (
    EQUAL,
    LESS,
    LEVEL,
    MARGIN,
    MORE,
    OPEN,
    Contrast,
    Runs,
    answers,
    group_runs,
    is_asked,
    metric_of,
)
from studies.second.plan import ARMS, FOLDER, FROZEN, IMAZU, PAIRS, SETTINGS, SIZES, TRAFFIC, plan_tasks
from studies.second.power import show_power

BOTH = "both"
POLICIES = ("keep_course", "vo")
# What the table of levels has of each run, and its headings.
METRICS = {
    "area": "area",
    "jumpstart": "before training",
    "start_success": "success before training",
    "end": "end",
    "success": "success in training",
    "perturbed": "from drawn starts",
    "replayed": "its actions replayed",
    "traffic": "traffic_test",
}
COLOURS = {MORE: "#0072B2", LESS: "#D55E00", EQUAL: "#009E73", OPEN: "#6b7280"}


def report(options: Namespace) -> None:
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


def read_table(setting: str) -> Runs:
    """Read the runs: those just made, or those that were kept.

    Raises:
        ConfigError: the table is no such table, or lacks runs.
    """
    wanted = (task.key(SETTINGS[setting]) for task in plan_tasks(SIZES[setting]))
    first = f"python -m studies.second run {setting}"
    return group_runs(read_runs(FOLDER / setting, wanted, first))


def write(setting: str, runs: Runs, found: list[Contrast], markdown: bool) -> None:
    """Print what was found of a setting; write a table and a picture."""
    show_contrasts(found, markdown)
    show_levels(runs, markdown)
    table, picture = FOLDER / f"{setting}_answers.csv", FOLDER / f"{setting}.png"
    write_csv(table, [asdict(one) for one in found])
    draw(picture, found)
    sys.stdout.write(f"{table}\n{picture}\n")


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
            one.verdict,
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
        told = [word for one in sides for word in (f"{one.value:+.3f}", share_of(one), one.verdict)]
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
    from studies.second.runs import policy_success

    cells, traffic = [], [policy_success(name, None) for name in POLICIES]
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


def draw(path: Path, found: list[Contrast]) -> None:
    """Write a PNG: each arm's gain as a share of the possible gain, a panel for each pair."""
    from matplotlib.figure import Figure

    from ship_trl.view.style import save_figure

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
        panels[0].plot([], [], "o-", color=colour, label=verdict)[0] for verdict, colour in COLOURS.items()
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), fontsize=9, frameon=False)
    figure.supxlabel(
        "gain in greedy area over scratch, as a share of what could be gained; grey band: the margin;\n"
        "95 % intervals are not adjusted, answers are",
        fontsize=10,
    )
    save_figure(figure, path)
