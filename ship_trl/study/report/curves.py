"""Learning curves: figures 5 to 7 and 9, a panel for each arm, with its greedy returns below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ship_trl.study.analysis.study import Study
from ship_trl.study.records.record import Record
from ship_trl.study.report.panels import REUSE_TITLE, Drawn, Section, lay_out, pair_sections, reuse_panels
from ship_trl.study.report.style import (
    FONT,
    GREY,
    NARROW,
    PALE,
    draw_curves,
    legend_above,
    look_of,
    points,
    set_episodes,
    set_range,
    smoothed,
)

# The share of a panel's height below the training returns, where the exploration rate is drawn.
STRIP = 0.14
WARMUP_ALPHA = 0.55
BEST_DASHES, RANDOM_DASHES = (0, (5, 2)), (0, (1, 2))


def draw_pair(study: Study, pair: str, width: float) -> Figure | None:
    """Draw figure 5, 6 or 7, or the figure of another pair; None without runs."""
    return draw(study, pair_sections(study, pair), width, 5)


def draw_reuse(study: Study, width: float) -> Figure | None:
    """Draw figure 9: the networks on the new case; None without runs."""
    panels = reuse_panels(study)
    return draw(study, [Section(REUSE_TITLE, panels)] if panels else [], width, 4)


def draw(study: Study, sections: Sequence[Section], width: float, columns: int) -> Figure | None:
    """Draw each panel's training returns above its greedy returns; all panels share their ranges."""
    if not sections:
        return None
    counts = sorted({len(study.arm(*panel.scratch)) for section in sections for panel in section.panels})
    handles = legend(f"scratch ({' or '.join(map(str, counts))})", has_warmup=study.plan.warmup > 0)
    heights = (1.0, 0.7) if width == NARROW else (1.2, 0.8)
    figure, drawn = lay_out(width, sections, columns, heights, "training episodes", handles)
    panels = [one for section in drawn for one in section]
    ranges = [draw_panel(study, one) for one in panels]
    for row, (label, below) in enumerate((("training return", STRIP), ("greedy return", 0.0))):
        set_range([one.axes[row] for one in panels], [each[row] for each in ranges], below)
        for one in panels:
            if one.is_first:
                one.axes[row].set_ylabel(label, fontsize=FONT, labelpad=2)
    return figure


def legend(scratch: str, *, has_warmup: bool) -> list[Artist]:
    """Return the legend of all panels."""
    warmup = [Patch(color=PALE, alpha=WARMUP_ALPHA, label="warm-up, no update yet")] if has_warmup else []
    return [
        Line2D([], [], color=look_of("scratch").colour, linewidth=1.5, label=scratch),
        Line2D([], [], color=GREY, linestyle=BEST_DASHES, linewidth=1, label="best known return"),
        Line2D([], [], color=GREY, linestyle=RANDOM_DASHES, linewidth=1.2, label="random actions"),
        Patch(color=PALE, label="exploration rate"),
        Line2D([], [], color=GREY, marker="|", markersize=9, linewidth=0, label="exploration ends"),
        *warmup,
    ]


def draw_panel(study: Study, drawn: Drawn) -> list[tuple[float, float]]:
    """Draw a panel's runs; returns the ranges of its training returns and its greedy returns."""
    panel = drawn.panel
    lines = [(panel.scratch, look_of("scratch")), *((arm.place, arm.look) for arm in panel.arms)]
    found = [(runs, look) for place, look in lines if (runs := list(study.arm(*place).values()))]
    # The levels are the same for all arms; the exploration rate is the arm's, or else that of scratch.
    run = found[min(1, len(found) - 1)][0][0]
    ranges = []
    for axis, read in zip(drawn.axes, (training, greedy), strict=True):
        values = [draw_curves(axis, *read(runs), look) for runs, look in found]
        for level, dashes in ((run.best_known, BEST_DASHES), (run.random, RANDOM_DASHES)):
            axis.axhline(level, color=GREY, linestyle=dashes, linewidth=0.9, zorder=1)
            values.append((level, level))
        set_episodes(axis, len(run.training.returns))
        if study.plan.warmup:
            axis.axvspan(0, study.plan.warmup, color=PALE, alpha=WARMUP_ALPHA, linewidth=0, zorder=0.4)
        ranges.append((min(low for low, _ in values), max(high for _, high in values)))
    draw_exploration(drawn.axes, run)
    names = [(f"{arm.name} ({len(study.arm(*arm.place))})", arm.look) for arm in panel.arms]
    legend_above(drawn.axes[0], names)
    return ranges


def training(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and moving training returns [S, T], up to the shortest run."""
    length = min(len(run.training.returns) for run in runs)
    shown = points(length)
    return shown + 1, smoothed(np.stack([run.training.returns[:length] for run in runs]))[:, shown]


def greedy(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and moving greedy returns [S, T], up to the shortest run."""
    count = min(len(run.greedy.returns) for run in runs)
    shown = points(count)
    values = smoothed(np.stack([run.greedy.returns[:count] for run in runs]))
    return runs[0].greedy.episode[:count][shown], values[:, shown]


def draw_exploration(axes: Sequence[Axes], run: Record) -> None:
    """Draw the exploration rate along the bottom of the first axes, and its end in all of them."""
    rate = run.training.epsilon
    shown = points(len(rate))
    bottom = axes[0].get_xaxis_transform()
    height = STRIP * rate[shown]
    axes[0].fill_between(shown + 1, 0, height, transform=bottom, color=PALE, linewidth=0, zorder=0.5)
    # The outline shows a low rate, too.
    axes[0].plot(shown + 1, height, transform=bottom, color=GREY, linewidth=0.6, zorder=0.6, clip_on=False)
    ended = np.flatnonzero(rate <= rate.min())[0]
    if 0 < ended < len(rate) - 1:
        for axis in axes:
            axis.axvline(ended + 1, color=GREY, linewidth=0.7, zorder=0.6)
