"""What each arm has more than scratch along the training, within seeds."""

from __future__ import annotations

from itertools import islice

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ship_trl.study.analysis.study import Study
from ship_trl.study.report.figures import (
    FONT,
    SCRATCH,
    Form,
    along,
    draw_curves,
    legend_above,
    places,
    smoothed,
)
from ship_trl.study.report.multiples import lay_out
from ship_trl.study.report.panels import Panel, Place, grouped_sections


def differences(study: Study, place: Place, scratch: Place) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and moving training scores less those from scratch [S, T], by seed."""
    runs = study.matched({"arm": place, "scratch": scratch})
    both = [*runs["arm"], *runs["scratch"]]
    length = min((len(run.training.returns) for run in both), default=0)
    if not length:
        return np.empty(0), np.empty((0, 0))
    one, two = (
        smoothed(np.stack([run.score(run.training.returns[:length]) for run in runs[name]]))
        for name in ("arm", "scratch")
    )
    shown = places(length)
    return shown + 1, (one - two)[:, shown]


def draw_differences(study: Study, form: Form) -> Figure | None:
    """Draw a section for each pair; None where there is nothing from scratch to compare with."""
    sections = grouped_sections(study)
    found = {
        arm.place: differences(study, arm.place, panel.scratch)
        for section in sections
        for panel in section.panels
        for arm in panel.arms
    }
    if not any(len(curves) for _, curves in found.values()):
        return None

    def names(panel: Panel) -> int:
        return len(panel.arms)

    figure, placed = lay_out(
        form, sections, 2 if form.narrow else 6, [1.0 if form.narrow else 1.2], names, "training episodes"
    )
    left = iter(placed)
    for section in sections:
        ranges, axes = [], []
        for one in islice(left, len(section.panels)):
            (axis,) = one.axes
            axes.append(axis)
            axis.axhline(0, color=SCRATCH.colour, linewidth=1.0, zorder=1.5)
            for arm in one.panel.arms:
                x, curves = found[arm.place]
                if len(curves):
                    ranges.append(draw_curves(axis, x, curves, arm.look))
                    along(axis, x[-1])
            shown = [(f"{arm.name} ({len(found[arm.place][1])})", arm.look) for arm in one.panel.arms]
            legend_above(axis, shown)
            if one.first:
                axis.set_ylabel("above scratch", fontsize=FONT, labelpad=2)
        share(axes, ranges)
    return figure


def share(axes: list[Axes], ranges: list[tuple[float, float]]) -> None:
    """Give the axes of a section the same range, with zero in it."""
    least = min((low for low, _ in ranges), default=0.0)
    most = max((high for _, high in ranges), default=0.0)
    least, most = min(least, 0.0), max(most, 0.0)
    room = 0.05 * (most - least) or 0.1
    for axis in axes:
        axis.set_ylim(least - room, most + room)
        axis.yaxis.set_major_locator(MaxNLocator(4))
