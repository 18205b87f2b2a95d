"""Figures along the training: learning curves, differences from scratch, times to the threshold."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ship_trl.files.record import RunRecord
from ship_trl.study.metrics import THRESHOLDS, has_reached, measure
from ship_trl.study.plan import SCRATCH, Place
from ship_trl.study.report.style import (
    GREY,
    NARROW,
    PALE,
    Panel,
    Sections,
    Trace,
    draw_curves,
    grouped_sections,
    lay_out,
    legend_above,
    look_of,
    pair_sections,
    points,
    reuse_panels,
    reuse_title,
    set_episodes,
    set_range,
    smooth,
)
from ship_trl.study.study import Study

# The share of a panel's height below the training returns, where the exploration rate is drawn.
STRIP = 0.14
WARMUP_ALPHA = 0.55
BEST_DASHES, RANDOM_DASHES = (0, (5, 2)), (0, (1, 2))
# Panels in a row of a wide figure; inches of a panel's height, by the figure's width.
COLUMNS, HEIGHT, NARROW_HEIGHT = 6, 1.2, 1.0


def draw_pair(study: Study, pair: str, width: float) -> Figure | None:
    """Draw figure 5, 6 or 7, or the figure of another pair; None without runs."""
    return draw_returns(study, pair_sections(study, pair), width, 5)


def draw_reuse(study: Study, width: float) -> Figure | None:
    """Draw figure 9: the networks on the new case; None without runs."""
    panels = reuse_panels(study)
    return draw_returns(study, {reuse_title(study): panels} if panels else {}, width, 4)


def draw_returns(study: Study, sections: Sections, width: float, columns: int) -> Figure | None:
    """Draw each panel's training returns above its greedy returns; all panels share their ranges."""
    if not sections:
        return None
    counts = sorted({len(study.arm(*panel.scratch)) for panels in sections.values() for panel in panels})
    scratch = f"scratch ({' or '.join(map(str, counts))})"
    handles: list[Artist] = [
        Line2D([], [], color=look_of(SCRATCH).colour, linewidth=1.5, label=scratch),
        Line2D([], [], color=GREY, linestyle=BEST_DASHES, linewidth=1, label="best known return"),
        Line2D([], [], color=GREY, linestyle=RANDOM_DASHES, linewidth=1.2, label="random actions"),
    ]
    panels = [panel for section in sections.values() for panel in section]
    if any(explores(run) for panel in panels for run in study.arm(*panel.scratch).values()):
        handles += [
            Patch(color=PALE, label="exploration rate"),
            Line2D([], [], color=GREY, marker="|", markersize=9, linewidth=0, label="exploration ends"),
        ]
    if study.plan.warmup:
        handles.append(Patch(color=PALE, alpha=WARMUP_ALPHA, label="warm-up, no update yet"))
    training, greedy = (1.0, 0.7) if width == NARROW else (1.2, 0.8)
    heights = {"training return": training, "greedy return": greedy}
    figure, drawn = lay_out(width, sections, columns, heights, "training episodes", handles)
    shown = [one for section in drawn for one in section]
    ranges = [draw_panel(study, panel, axes) for panel, axes in shown]
    for row, below in enumerate((STRIP, 0.0)):
        set_range([axes[row] for _, axes in shown], [each[row] for each in ranges], below)
    return figure


def draw_panel(study: Study, panel: Panel, axes: Sequence[Axes]) -> list[tuple[float, float]]:
    """Draw a panel's runs; return the ranges of its training returns and its greedy returns."""
    lines = [(panel.scratch, look_of(SCRATCH)), *((arm.place, arm.look) for arm in panel.arms)]
    found = [(runs, look) for place, look in lines if (runs := list(study.arm(*place).values()))]
    # The levels are the same for all arms; the exploration rate is the arm's, or else that of scratch.
    run = found[min(1, len(found) - 1)][0][0]
    ranges = []
    for axis, kind in zip(axes, (attrgetter("training"), attrgetter("greedy")), strict=True):
        values = []
        for runs, look in found:
            shown, returns = smooth([kind(run).returns for run in runs])
            values.append(draw_curves(axis, kind(runs[0]).episode[shown], returns, look))
        for level, dashes in ((run.best_known, BEST_DASHES), (run.random_return, RANDOM_DASHES)):
            axis.axhline(level, color=GREY, linestyle=dashes, linewidth=0.9, zorder=1)
            values.append((level, level))
        set_episodes(axis, len(run.training.returns))
        if study.plan.warmup:
            axis.axvspan(0, study.plan.warmup, color=PALE, alpha=WARMUP_ALPHA, linewidth=0, zorder=0.4)
        ranges.append((min(low for low, _ in values), max(high for _, high in values)))
    draw_exploration(axes, run)
    legend_above(axes[0], [(f"{arm.name} ({len(study.arm(*arm.place))})", arm.look) for arm in panel.arms])
    return ranges


def explores(run: RunRecord) -> bool:
    """Return whether the run had an exploration rate."""
    return not bool(np.isnan(run.training.epsilon).all())


def draw_exploration(axes: Sequence[Axes], run: RunRecord) -> None:
    """Draw the exploration rate along the bottom of the first axes, and its end in all of them."""
    rate = run.training.epsilon
    if not explores(run):
        return
    shown = points(len(rate))
    bottom = axes[0].get_xaxis_transform()
    height = STRIP * rate[shown]
    axes[0].fill_between(shown + 1, 0, height, transform=bottom, color=PALE, linewidth=0, zorder=0.5)
    # The outline makes a low rate visible.
    axes[0].plot(shown + 1, height, transform=bottom, color=GREY, linewidth=0.6, zorder=0.6, clip_on=False)
    ended = np.flatnonzero(rate <= rate.min())[0]
    if 0 < ended < len(rate) - 1:
        for axis in axes:
            axis.axvline(ended + 1, color=GREY, linewidth=0.7, zorder=0.6)


def differences(study: Study, place: Place, scratch: Place) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and, by seed, moving training scores minus those of scratch [S, T]."""
    runs = study.matched({"arm": place, "scratch": scratch})
    count = len(runs["arm"])
    if not count:
        return np.empty(0), np.empty((0, 0))
    shown, scores = smooth([run.scores for run in runs["arm"] + runs["scratch"]])
    return shown + 1, scores[:count] - scores[count:]


def draw_differences(study: Study, width: float) -> Figure | None:
    """Draw each arm's differences from scratch; None where there is nothing to compare with."""
    sections = grouped_sections(study)
    panels = [panel for section in sections.values() for panel in section]
    found = {
        arm.place: differences(study, arm.place, panel.scratch) for panel in panels for arm in panel.arms
    }
    if not any(len(curves) for _, curves in found.values()):
        return None
    heights = {"above scratch": NARROW_HEIGHT if width == NARROW else HEIGHT}
    figure, drawn = lay_out(width, sections, COLUMNS, heights, "training episodes")
    for section in drawn:
        # The range of a section holds zero.
        ranges = [(0.0, 0.0)]
        for panel, (axis,) in section:
            axis.axhline(0, color=look_of(SCRATCH).colour, linewidth=1.0, zorder=1.5)
            for arm in panel.arms:
                x, curves = found[arm.place]
                if len(curves):
                    ranges.append(draw_curves(axis, x, curves, arm.look))
                    set_episodes(axis, x[-1])
            names = [(f"{arm.name} ({len(found[arm.place][1])})", arm.look) for arm in panel.arms]
            legend_above(axis, names)
        set_range([axis for _, (axis,) in section], ranges)
    return figure


def steps(runs: Sequence[RunRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Return times from 0 to 1, and the share of the runs that have reached the threshold by then.

    A run that never reaches it counts among all runs, so the last share is below 1.
    """
    times = sorted(measure(run, "time") for run in runs if has_reached(run))
    shares = np.arange(len(times) + 1) / len(runs)
    return np.array([0.0, *times, 1.0]), np.append(shares, shares[-1])


def draw_times(study: Study, width: float) -> Figure | None:
    """Draw how many runs of each arm have reached the threshold over time; None without runs."""
    sections = grouped_sections(study)
    if not sections:
        return None
    label = f"share of the episodes until the moving score is at {THRESHOLDS[0]:g}"
    heights = {"share of the runs": NARROW_HEIGHT if width == NARROW else HEIGHT}
    figure, drawn = lay_out(width, sections, COLUMNS, heights, label, names=1)
    for panel, (axis,) in (one for section in drawn for one in section):
        names = []
        for arm in (Trace(SCRATCH, panel.scratch, look_of(SCRATCH)), *panel.arms):
            if runs := list(study.arm(*arm.place).values()):
                style = {"color": arm.look.colour, "linestyle": arm.look.dashes, "linewidth": 1.3}
                axis.step(*steps(runs), where="post", clip_on=False, **style)
                names.append((f"{arm.name} {sum(map(has_reached, runs))}/{len(runs)}", arm.look))
        legend_above(axis, names)
        set_episodes(axis, 1)
        # A step at 1 stays clear of the names above it.
        axis.set_ylim(0, 1.06)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    return figure
