"""Judge the contrasts of the second study: print, and write a table and a picture."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from ship_trl.config.arm import SCRATCH
from ship_trl.config.errors import ConfigError
from ship_trl.run.console import show
from ship_trl.study.report.tables import write_csv
from ship_trl.study.statistics import LEVEL, Sample
from studies.lockstep import read_runs
from studies.second.answers import (
    EQUAL,
    LESS,
    MARGIN,
    MORE,
    OPEN,
    Row,
    Runs,
    answers,
    group_runs,
    is_asked,
)
from studies.second.plan import ARMS, FOLDER, FROZEN, IMAZU, PAIRS, SETTINGS, SIZES, TRAFFIC, plan_tasks
from studies.sources.plan import FOLDER as SOURCES

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
# Each arm has its colour, each answer its mark.
MARKS = {MORE: ">", LESS: "<", EQUAL: "s", OPEN: "o"}
# Simulated studies of a row of the power, and their seed.
DRAWS, SEED = 2000, 2022


def report(options: Namespace) -> None:
    """Do what the options ask for."""
    if options.power:
        if options.setting not in SETTINGS:
            setting = options.setting or "no setting"
            raise ConfigError(f"answers: --power with {setting}; allowed: with numbers or pixels")
        show_power(options.setting, options.markdown)
        return
    settings = tuple(SETTINGS) if options.setting in (BOTH, None) else (options.setting,)
    runs = {
        name: group_runs(read_runs(FOLDER / name, plan_tasks(name), f"python -m studies.second run {name}"))
        for name in settings
    }
    found = {name: answers(read) for name, read in runs.items()}
    for name in settings if options.setting != BOTH else ():
        sys.stdout.write(f"From {name}\n\n" if len(settings) > 1 else "")
        show_contrasts(found[name].to_dict("records"), options.markdown)
        show_levels(runs[name], options.markdown)
        table, picture = FOLDER / f"{name}_answers.csv", FOLDER / f"{name}.png"
        write_csv(table, found[name].to_dict("records"))
        draw(picture, found[name])
        sys.stdout.write(f"{table}\n{picture}\n")
    if len(settings) > 1:
        show_beside(found, options.markdown)


def show_contrasts(found: list[Row], markdown: bool) -> None:
    """Print a row for each contrast."""
    headings = "question", "where", "contrast", "difference", "of possible gain", "runs", "p", "answer"
    cells = [
        (
            *(str(one["question"]), one["where"], one["what"]),
            f"{one['value']:+.3f} ({one['low']:+.3f} to {one['high']:+.3f})",
            *(share_of(one), one["count"], f"{one['p']:.2g}", one["verdict"]),
        )
        for one in found
    ]
    show(headings, cells, markdown)


def show_beside(found: Mapping[str, pd.DataFrame], markdown: bool) -> None:
    """Print what each observation says of questions 1 and 2, and their distance in standard errors."""
    asked = [table[table["question"].isin((1, 2))].to_dict("records") for table in found.values()]
    cells = []
    for sides in zip(*asked, strict=True):
        name = str(sides[0]["question"]), sides[0]["where"], sides[0]["what"]
        told = [word for one in sides for word in (f"{one['value']:+.3f}", share_of(one), one["verdict"])]
        is_alike = len({one["value"] > 0 for one in sides}) == 1
        # Standard errors, about, from 95 % intervals.
        errors = [(one["high"] - one["low"]) / (2 * stats.norm.ppf(1 - LEVEL / 2)) for one in sides]
        apart = (sides[0]["value"] - sides[1]["value"]) / math.hypot(*errors)
        cells.append((*name, *told, "yes" if is_alike else "no", f"{apart:+.1f}"))
    headings = [word for name in found for word in (f"from {name}", "of possible gain", "answer")]
    show(("question", "where", "contrast", *headings, "same sign", "apart"), cells, markdown)


def share_of(one: Row) -> str:
    """Write the share of what could be gained, where that means something."""
    is_gain = np.isfinite(one["possible_gain"]) and one["question"] != 2
    return f"{one['value'] / one['possible_gain']:.0%}" if is_gain else ""


def show_levels(runs: Runs, markdown: bool) -> None:
    """Print each arm's means and its success on unseen scenes, beside two policies."""
    from studies.second.runs import policy_success

    places = {pair: [(target, source)] for pair, (source, target) in PAIRS.items()}
    if is_asked(runs, 3):
        places["imazu"] = [(target, TRAFFIC) for target in IMAZU]
    cells = []
    for where, pairs in places.items():
        # By the name of a row: target, source and arm of its runs.
        rows = {SCRATCH.name: [(target, "", SCRATCH.name) for target, _ in pairs]}
        rows |= {arm: [(*pair, arm) for pair in pairs] for arm in (*ARMS, FROZEN)}
        rows[f"{FROZEN} of the target"] = [(target, target, FROZEN) for target, _ in pairs]
        for name, groups in rows.items():
            if all((*group, "") in runs for group in groups):
                levels = [
                    [runs[*group, ""][metric].to_numpy().mean() for metric in METRICS] for group in groups
                ]
                cells.append((where, name, *(f"{value:.2f}" for value in np.mean(levels, axis=0))))
        for name in POLICIES:
            share = np.mean([policy_success(name, target) for target, _ in pairs])
            blanks = ("",) * (len(METRICS) - 3)
            cells.append((where, name, *blanks, f"{share:.2f}", "", f"{policy_success(name, None):.2f}"))
    show(("where", "arm", *METRICS.values()), cells, markdown)


def draw(path: Path, found: pd.DataFrame) -> None:
    """Write a PNG: each arm's gain as a share of the possible gain, a panel for each pair."""
    from matplotlib.figure import Figure

    from ship_trl.view.style import GREY, look_of, save_figure

    shown = found[found["question"].isin((1, 3)) & found["what"].str.endswith("less scratch")]
    wheres = shown["where"].unique()
    figure = Figure(figsize=(3.2 * len(wheres), 3.4), dpi=110, layout="constrained")
    panels = figure.subplots(1, len(wheres), sharex=True, squeeze=False)[0]
    for axes, where in zip(panels, wheres, strict=True):
        own = shown[shown["where"] == where].to_dict("records")
        names = [one["what"].removesuffix(" less scratch") for one in own]
        axes.axvspan(-MARGIN, MARGIN, color="#eef0f3", zorder=0)
        for at in (0.0, 1.0):
            axes.axvline(at, color="#6b7280", linewidth=0.8)
        for row, one in enumerate(own):
            low, value, high = (one[name] / one["possible_gain"] for name in ("low", "value", "high"))
            colour, verdict = look_of(names[row])["color"], one["verdict"]
            face = "white" if verdict == OPEN else colour
            axes.plot((low, high), (row, row), color=colour, linewidth=2)
            axes.plot(value, row, MARKS[verdict], color=colour, markersize=7, markerfacecolor=face)
        axes.set_yticks(range(len(own)), names, fontsize=10)
        axes.set_ylim(len(own) - 0.5, -0.5)
        axes.set_title(where, fontsize=11, loc="left")
        axes.set_xlabel("better \N{RIGHTWARDS ARROW}", fontsize=9, loc="right")
        axes.tick_params(axis="x", labelsize=9)
    handles = [
        panels[0].plot([], [], mark, color=GREY, label=verdict, mfc="white" if verdict == OPEN else GREY)[0]
        for verdict, mark in MARKS.items()
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), fontsize=9, frameon=False)
    figure.supxlabel(
        "gain in greedy area over scratch, as a share of what could be gained; grey band: the margin;\n"
        "95 % intervals are not adjusted, answers are",
        fontsize=10,
    )
    save_figure(figure, path)


def show_power(setting: str, markdown: bool) -> None:
    """Print how often a contrast of question 1 is found, after Bonferroni's correction.

    Samples are drawn from the residuals of the runs of the study of sources: from scratch, and of its arms.
    """
    sizes, generator = SIZES[setting], np.random.default_rng(SEED)
    kept = read_runs(SOURCES / setting, (), f"python -m studies.sources run {setting}")
    level = LEVEL / (len(PAIRS) * (len(ARMS) + 2))
    areas = kept[kept["length"] == kept["length"].min()].groupby(["target", "source", "arm"])["area"]
    samples = {place: own.to_numpy() for place, own in areas}
    cells = []
    for pair, (source, target) in PAIRS.items():
        base = samples[target, "", SCRATCH.name]
        could = 1 - float(np.mean(base))
        for arm in kept.loc[kept["source"] != "", "arm"].unique():
            powers = []
            for share in (0.0, MARGIN, 0.5):
                one = generator.choice(residuals(samples[target, source, arm]), (DRAWS, sizes.arm))
                other = generator.choice(residuals(base), (DRAWS, sizes.scratch))
                found = stats.ttest_ind(one + share * could, other, axis=1, equal_var=False)
                is_found = (found.pvalue <= level) & ((found.statistic > 0) | (share == 0.0))
                powers.append(f"{np.mean(is_found):.2f}")
            cells.append((pair, arm, f"{could:.2f}", *powers))
    show(("pair", "arm", "could be gained", "nothing", "the margin", "half of it"), cells, markdown)


def residuals(areas: Sample) -> Sample:
    """Return residuals with the sample's standard deviation."""
    found: Sample = (areas - areas.mean()) * np.sqrt(len(areas) / (len(areas) - 1))
    return found
