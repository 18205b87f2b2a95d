"""Learning curves: figures 5 to 7 and 9, a small panel for each arm, greedy returns below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from ship_trl.study.analysis.study import Study
from ship_trl.study.records.record import Record
from ship_trl.study.report.figures import (
    FONT,
    GREY,
    PALE,
    SCRATCH,
    Form,
    along,
    draw_curves,
    legend_above,
    places,
    smoothed,
)
from ship_trl.study.report.multiples import Placed, lay_out
from ship_trl.study.report.panels import REUSE, Panel, Section, pair_sections, reuse_panels

# Of a panel's height, for the exploration rate from 0 to 1.
STRIP = 0.14
# How much the warm-up is shaded, below the exploration rate.
WARMUP = 0.55
BEST, RANDOM = (0, (5, 2)), (0, (1, 2))


def draw_pair(study: Study, pair: str, form: Form) -> Figure | None:
    """Draw figure 5, 6 or 7, or that of another pair; None without runs."""
    return draw(study, pair_sections(study, pair), form, 5)


def draw_reuse(study: Study, form: Form) -> Figure | None:
    """Draw figure 9: the reused network on the new case, and sources trained alike; None without runs."""
    panels = reuse_panels(study)
    return draw(study, [Section(REUSE, panels)] if panels else [], form, 4)


def draw(study: Study, sections: Sequence[Section], form: Form, columns: int) -> Figure | None:
    """Draw each panel's training returns above its greedy returns, on shared axes."""
    if not sections:
        return None

    def names(panel: Panel) -> int:
        return len(panel.arms)

    heights = (1.0, 0.7) if form.narrow else (1.25, 0.8)
    counts = sorted({len(study.arm(*panel.scratch)) for section in sections for panel in section.panels})
    handles = legend(f"scratch ({' or '.join(map(str, counts))})", warm=study.warmup > 0)
    across = 2 if form.narrow else columns
    figure, placed = lay_out(form, sections, across, heights, names, "training episodes", handles)
    for row, values in enumerate(zip(*(draw_panel(study, one) for one in placed), strict=True)):
        least, most = min(low for low, _ in values), max(high for _, high in values)
        room = 0.04 * (most - least)
        # Under the training returns there is room for the exploration rate.
        under = (most - least) * STRIP / (1 - STRIP) + room if row == 0 else room
        for one in placed:
            one.axes[row].set_ylim(least - under, most + room)
    for one in placed:
        if one.first:
            for axis, label in zip(one.axes, ("training return", "greedy return"), strict=True):
                axis.set_ylabel(label, fontsize=FONT, labelpad=2)
    return figure


def legend(scratch: str, *, warm: bool) -> list[Artist]:
    """Return what is named once for all panels."""
    warmup = [Patch(color=PALE, alpha=WARMUP, label="warm-up, no update yet")] if warm else []
    return [
        Line2D([], [], color=SCRATCH.colour, linewidth=1.5, label=scratch),
        Line2D([], [], color=GREY, linestyle=BEST, linewidth=1, label="best known return"),
        Line2D([], [], color=GREY, linestyle=RANDOM, linewidth=1.2, label="random actions"),
        Patch(color=PALE, label="exploration rate"),
        Line2D([], [], color=GREY, marker="|", markersize=9, linewidth=0, label="exploration ends"),
        *warmup,
    ]


def draw_panel(study: Study, placed: Placed) -> list[tuple[float, float]]:
    """Draw a panel's runs; returns the least and the largest value of its training and its greedy returns."""
    panel = placed.panel
    lines = [
        (list(study.arm(*panel.scratch).values()), SCRATCH),
        *((list(study.arm(*arm.place).values()), arm.look) for arm in panel.arms),
    ]
    found = [(runs, look) for runs, look in lines if runs]
    ranges: list[list[tuple[float, float]]] = [[], []]
    for runs, look in found:
        for axis, seen, (x, curves) in zip(placed.axes, ranges, (training(runs), greedy(runs)), strict=True):
            seen.append(draw_curves(axis, x, curves, look))
    # Returns of all are alike, of one case; the exploration rate is the arm's, where there is one.
    one = found[min(1, len(found) - 1)][0][0]
    for axis, seen in zip(placed.axes, ranges, strict=True):
        for level, dashes in ((one.best_known, BEST), (one.random, RANDOM)):
            axis.axhline(level, color=GREY, linestyle=dashes, linewidth=0.9, zorder=1)
            seen.append((level, level))
        along(axis, len(one.training.returns))
        # A run with shorter episodes learns some episodes later.
        if study.warmup:
            axis.axvspan(0, study.warmup, color=PALE, alpha=WARMUP, linewidth=0, zorder=0.4)
        axis.yaxis.set_major_locator(MaxNLocator(4))
    draw_exploration(placed.axes, one)
    legend_above(
        placed.axes[0], [(f"{arm.name} ({len(study.arm(*arm.place))})", arm.look) for arm in panel.arms]
    )
    return [(min(low for low, _ in seen), max(high for _, high in seen)) for seen in ranges]


def training(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and moving training returns [S, T] of runs, as far as all of them go."""
    length = min(len(run.training.returns) for run in runs)
    shown = places(length)
    return shown + 1, smoothed(np.stack([run.training.returns[:length] for run in runs]))[:, shown]


def greedy(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return after how many episodes [T], and moving greedy returns [S, T], as far as all runs go."""
    count = min(len(run.greedy.returns) for run in runs)
    shown = places(count)
    values = smoothed(np.stack([run.greedy.returns[:count] for run in runs]))
    return runs[0].greedy.episode[:count][shown], values[:, shown]


def draw_exploration(axes: Sequence[Axes], run: Record) -> None:
    """Shade the exploration rate along the foot of the first axes, and mark in all of them where it ends."""
    rate = run.training.epsilon
    shown = places(len(rate))
    foot = axes[0]
    across = foot.get_xaxis_transform()
    height = STRIP * rate[shown]
    foot.fill_between(shown + 1, 0, height, transform=across, color=PALE, linewidth=0, zorder=0.5)
    # A low rate is a line that can be seen.
    foot.plot(shown + 1, height, transform=across, color=GREY, linewidth=0.6, zorder=0.6, clip_on=False)
    ended = np.flatnonzero(rate <= rate.min())[0]
    if 0 < ended < len(rate) - 1:
        for axis in axes:
            axis.axvline(ended + 1, color=GREY, linewidth=0.7, zorder=0.6)
