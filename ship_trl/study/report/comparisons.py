"""Arms beside each other: differences from scratch along the training, and times to the threshold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ship_trl.study.analysis.metrics import THRESHOLDS, has_reached, measure
from ship_trl.study.analysis.study import Study
from ship_trl.study.plan.arms import SCRATCH
from ship_trl.study.plan.jobs import Place
from ship_trl.study.records.record import Record
from ship_trl.study.report.panels import Arm, grouped_sections, lay_out
from ship_trl.study.report.style import (
    FONT,
    NARROW,
    draw_curves,
    legend_above,
    look_of,
    points,
    set_episodes,
    set_range,
    smoothed,
)

# Panels in a row of a wide figure; inches of a panel's height, by the figure's width.
COLUMNS, HEIGHT, NARROW_HEIGHT = 6, 1.2, 1.0


def differences(study: Study, place: Place, scratch: Place) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and moving training scores less those of scratch [S, T], by seed."""
    runs = study.matched({"arm": place, "scratch": scratch})
    length = min((len(run.training.returns) for both in runs.values() for run in both), default=0)
    if not length:
        return np.empty(0), np.empty((0, 0))
    one, two = (
        smoothed(np.stack([run.score(run.training.returns[:length]) for run in runs[name]]))
        for name in ("arm", "scratch")
    )
    shown = points(length)
    return shown + 1, (one - two)[:, shown]


def draw_differences(study: Study, width: float) -> Figure | None:
    """Draw each arm's differences from scratch; None where there is nothing to compare with."""
    sections = grouped_sections(study)
    found = {
        arm.place: differences(study, arm.place, panel.scratch)
        for section in sections
        for panel in section.panels
        for arm in panel.arms
    }
    if not any(len(curves) for _, curves in found.values()):
        return None
    height = NARROW_HEIGHT if width == NARROW else HEIGHT
    figure, drawn = lay_out(width, sections, COLUMNS, [height], "training episodes")
    for section in drawn:
        # The range of a section holds zero.
        ranges = [(0.0, 0.0)]
        for one in section:
            (axis,) = one.axes
            axis.axhline(0, color=look_of(SCRATCH).colour, linewidth=1.0, zorder=1.5)
            for arm in one.panel.arms:
                x, curves = found[arm.place]
                if len(curves):
                    ranges.append(draw_curves(axis, x, curves, arm.look))
                    set_episodes(axis, x[-1])
            names = [(f"{arm.name} ({len(found[arm.place][1])})", arm.look) for arm in one.panel.arms]
            legend_above(axis, names)
            if one.is_first:
                axis.set_ylabel("above scratch", fontsize=FONT, labelpad=2)
        set_range([one.axes[0] for one in section], ranges)
    return figure


def steps(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return times from 0 to 1, and the share of the runs that have reached the threshold by then.

    A run that never reaches it counts among all runs, so the last share is below 1.
    """
    times = sorted(measure(run, "time") for run in runs if has_reached(run))
    shares = np.arange(len(times) + 1) / len(runs)
    return np.array([0.0, *times, 1.0]), np.append(shares, shares[-1])


def draw_times(study: Study, width: float) -> Figure | None:
    """Draw how many runs of each arm have reached the threshold; None without runs."""
    sections = grouped_sections(study)
    if not sections:
        return None
    label = f"share of the episodes until the moving score is at {THRESHOLDS[0]:g}"
    height = NARROW_HEIGHT if width == NARROW else HEIGHT
    figure, drawn = lay_out(width, sections, COLUMNS, [height], label, names=1)
    for one in (panel for section in drawn for panel in section):
        (axis,) = one.axes
        names = []
        for arm in (Arm(SCRATCH, one.panel.scratch, look_of(SCRATCH)), *one.panel.arms):
            runs = list(study.arm(*arm.place).values())
            if not runs:
                continue
            style = {"color": arm.look.colour, "linestyle": arm.look.dashes, "linewidth": 1.3}
            axis.step(*steps(runs), where="post", clip_on=False, **style)
            names.append((f"{arm.name} {sum(map(has_reached, runs))}/{len(runs)}", arm.look))
        legend_above(axis, names)
        set_episodes(axis, 1)
        # A step at 1 stays clear of the names above it.
        axis.set_ylim(0, 1.06)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
        if one.is_first:
            axis.set_ylabel("share of the runs", fontsize=FONT, labelpad=2)
    return figure
