"""Draw learning curves: of one run, of a transfer beside runs from scratch, of many arms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from ship_trl.files.curve import moving_mean
from ship_trl.files.record import Evaluation, RunRecord
from ship_trl.learn.train import Finished
from ship_trl.view.chart import save, tidy
from ship_trl.view.palette import (
    BEST_KNOWN,
    CHART_OUTCOMES,
    CHART_SERIES,
    EPSILON,
    MUTED,
    SCRATCH,
    arm_styles,
)
from ship_trl.view.words import counted, number

# Episodes in the moving mean of training returns.
MEAN_OVER = 25
# Collisions cost 300 and more; only returns above this differ between policies that reach the goal.
LOWEST_GREEDY = -100.0
# Inches of a panel of a comparison, and panels in a row.
PANEL_SIZE, COLUMNS = (5.2, 6.4), 3
# Letters in a row of a panel's legend, and those that the line of an entry takes.
LEGEND_LETTERS, SAMPLE_LETTERS = 84, 9

Returns = NDArray[np.float64]


# The runs of an arm, one for each seed, by its name.
Groups = Mapping[str, Sequence[RunRecord]]


def draw_curve(
    path: Path,
    finished: Sequence[Finished],
    evaluated: Sequence[Evaluation],
    best_return: float | None,
    title: str,
) -> None:
    """Write the learning curve of one run as a PNG of 1200 x 800.

    Greedy evaluations of several episodes have success rates in place of outcomes. Without a `best_return`
    there is no line for it.
    """
    figure = Figure(figsize=(12, 8), dpi=100, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    has_rates = evaluated[0].episodes > 1
    # Names of files in the title may contain a dollar sign.
    figure.suptitle(title, fontsize=15, fontweight="bold", parse_math=False)
    for outcome, (colour, marker) in CHART_OUTCOMES.items():
        style: dict[str, Any] = {"linestyle": "", "marker": marker, "color": colour}
        trained = [(row.episode, row.episode_return) for row in finished if row.outcome == outcome]
        # The legend also lists an outcome that never happened.
        label = f"training: {outcome} ({len(trained)})"
        upper.plot(*np.reshape(trained, (-1, 2)).T, markersize=4, alpha=0.4, label=label, **style)
        alone = [one for one in evaluated if one.outcome == outcome and not has_rates]
        greedy = [(one.episode, one.episode_return) for one in alone]
        if greedy:
            # A cross consists only of its edge.
            edge = colour if marker == "x" else SCRATCH
            label = f"greedy: {outcome} ({len(greedy)})"
            upper.plot(*np.transpose(greedy), markersize=7, mec=edge, zorder=4, label=label, **style)
    episodes = [row.episode for row in finished]
    mean = moving_mean([row.episode_return for row in finished], MEAN_OVER)
    label = f"training: mean of {MEAN_OVER}"
    upper.plot(episodes, mean, color=CHART_SERIES[0], linewidth=2.2, label=label)
    steps, returns = [one.episode for one in evaluated], [one.episode_return for one in evaluated]
    label = "greedy evaluation, mean" if has_rates else "greedy evaluation"
    upper.step(steps, returns, where="post", color=SCRATCH, linewidth=1.2, label=label)
    if has_rates:
        label, rates = "greedy share of goals", [one.success_rate for one in evaluated]
        lower.step(steps, rates, where="post", color=SCRATCH, linewidth=1.2, label=label)
    upper.set_ylabel("return of an episode (undiscounted raw reward)")
    if best_return is not None:
        best = f"best known: {best_return:.1f}"
        upper.axhline(best_return, color=BEST_KNOWN, linestyle="--", linewidth=1.8, label=best)
    for outcome, line in (("goal", "-"), ("collision", "-.")):
        share = moving_mean([row.outcome == outcome for row in finished], MEAN_OVER)
        style = {"color": CHART_OUTCOMES[outcome][0], "linestyle": line}
        lower.plot(episodes, share, label=f"share of {outcome}s, last {MEAN_OVER}", **style)
    epsilons = [row.epsilon for row in finished]
    if not np.isnan(epsilons).all():
        lower.plot(episodes, epsilons, color=EPSILON, linestyle=":", linewidth=2, label="exploration rate ε")
    lower.set(ylim=(-0.04, 1.04), ylabel="share (0 to 1)", xlabel="training episodes")
    for axes in (upper, lower):
        tidy(axes)
        axes.margins(x=0.01)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=10.5)
    save(figure, path)


def draw_transfer(
    path: Path, arm: str, returns: Sequence[float], scratch: Returns, best_return: float | None, title: str
) -> None:
    """Write the training returns of a transfer [E] and of runs from scratch [S, E] as a PNG of 1200 x 750."""
    figure = Figure(figsize=(12, 7.5), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.set_title(f"{title}, beside learning from scratch", fontsize=15, loc="left", parse_math=False)
    smooth = moving_mean(scratch, MEAN_OVER)
    seeds = counted(len(scratch), "seed")
    if len(scratch) > 1:
        seeds += ", median; band: from the worst to the best"
    label = f"from scratch: {seeds}; mean of all episodes {number(scratch.mean(), '.0f')}"
    episodes = np.arange(1, smooth.shape[1] + 1)
    _draw_band(axes, episodes, smooth, label, {"color": SCRATCH, "linestyle": "--"}, 2.2)
    mean = moving_mean(returns, MEAN_OVER)
    label = f"{arm}, this run; mean of all episodes {number(float(np.mean(returns)), '.0f')}"
    axes.plot(np.arange(1, len(mean) + 1), mean, color=CHART_SERIES[0], linewidth=2.8, label=label)
    if best_return is not None:
        label = f"best known return: {best_return:.1f}"
        axes.axhline(best_return, color=BEST_KNOWN, linestyle=":", linewidth=2.2, label=label)
    axes.set_xlabel("training episodes", fontsize=12)
    axes.set_ylabel(f"training return, mean of the last {MEAN_OVER} episodes", fontsize=12)
    tidy(axes)
    axes.margins(x=0.01)
    figure.legend(loc="outside lower left", ncols=1, frameon=False, fontsize=12)
    save(figure, path)


def draw_comparison(path: Path, panels: Mapping[str, Groups]) -> None:
    """Write a PNG with a panel for each pair: training returns above, greedy returns below."""
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    size = (PANEL_SIZE[0] * columns, PANEL_SIZE[1] * rows)
    figure = Figure(figsize=size, dpi=100, layout="constrained")
    places = figure.subfigures(rows, columns, squeeze=False).flat
    for place, (title, groups) in zip(places, panels.items(), strict=False):
        _draw_panel(place, title, groups)
    save(figure, path)


def _draw_panel(place: SubFigure, title: str, groups: Groups) -> None:
    best = next(iter(groups.values()))[0].best_known_return
    upper, lower = place.subplots(2, 1, sharex=True)
    upper.set_title(title, parse_math=False)
    styles = arm_styles(list(groups))
    for name, runs in groups.items():
        length = min(len(run.training.returns) for run in runs)
        smooth = moving_mean(np.stack([run.training.returns[:length] for run in runs]), MEAN_OVER)
        label = f"{name} ({counted(len(runs), 'seed')})"
        _draw_band(upper, np.arange(1, length + 1), smooth, label, styles[name], 1.8)
        length = min(len(run.greedy.returns) for run in runs)
        greedy = np.stack([run.greedy.returns[:length] for run in runs])
        _draw_band(lower, runs[0].greedy.episode[:length], greedy, name, styles[name], 1.8)
    for axes in (upper, lower):
        if best is not None:
            axes.axhline(best, color=MUTED, linewidth=1, label=f"best known: {best:.1f}")
        tidy(axes)
    # Where no greedy return is above the bound, it would hide all of them.
    highest = max((float(run.greedy.returns.max()) for runs in groups.values() for run in runs), default=0.0)
    lowest = LOWEST_GREEDY if highest > LOWEST_GREEDY else None
    lower.set_ylim(lowest, None if best is None else best + 15)
    lower.set_xlabel("training episodes")
    upper.set_ylabel(f"training return, mean of {MEAN_OVER}\n(median of seeds; band: all)")
    lower.set_ylabel("greedy return\n(median of seeds; band: all)")
    lines, names = upper.get_legend_handles_labels()
    in_a_row = max(1, LEGEND_LETTERS // (max(map(len, names)) + SAMPLE_LETTERS))
    place.legend(lines, names, loc="outside lower center", ncols=in_a_row, fontsize=8, frameon=False)


def _draw_band(
    axes: Axes, x: NDArray[np.int64], values: Returns, label: str, style: Mapping[str, Any], width: float
) -> None:
    """Draw the median of `values` [S, N] over seeds as a line, and their range as a band."""
    axes.plot(x, np.median(values, axis=0), label=label, linewidth=width, **style)
    axes.fill_between(x, values.min(axis=0), values.max(axis=0), color=style["color"], alpha=0.15, lw=0)
