"""How many runs of each arm have reached the threshold, along the training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ship_trl.study.analysis.metrics import THRESHOLDS, measure, reached
from ship_trl.study.analysis.study import Study
from ship_trl.study.records.record import Record
from ship_trl.study.report.figures import FONT, SCRATCH, Form, along, legend_above
from ship_trl.study.report.multiples import lay_out
from ship_trl.study.report.panels import Arm, Panel, grouped_sections


def steps(runs: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return times to the threshold and the share of the runs that are there then, from 0 to the end.

    A run that never gets there counts among all and never as there: it is cut off at the end, and the last
    share is below 1.
    """
    times = sorted(measure(run, "time") for run in runs if reached(run))
    shares = np.arange(len(times) + 1) / len(runs)
    return np.array([0.0, *times, 1.0]), np.append(shares, shares[-1])


def draw_times(study: Study, form: Form) -> Figure | None:
    """Draw a section for each pair, a step for each run; None without runs."""
    sections = grouped_sections(study)
    if not sections:
        return None

    def names(panel: Panel) -> int:
        return 1 + len(panel.arms)

    below = f"share of the episodes until the moving score is at {THRESHOLDS[0]:g}"
    height = 1.0 if form.narrow else 1.2
    figure, placed = lay_out(form, sections, 2 if form.narrow else 6, [height], names, below)
    for one in placed:
        (axis,) = one.axes
        told = []
        for arm in (Arm("scratch", one.panel.scratch, SCRATCH), *one.panel.arms):
            runs = list(study.arm(*arm.place).values())
            if not runs:
                continue
            axis.step(
                *steps(runs),
                where="post",
                color=arm.look.colour,
                linestyle=arm.look.dashes,
                linewidth=1.3,
                clip_on=False,
            )
            told.append((f"{arm.name} {sum(map(reached, runs))}/{len(runs)}", arm.look))
        legend_above(axis, told)
        along(axis, 1)
        # A step at 1 stays clear of the names above it.
        axis.set_ylim(0, 1.06)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
        if one.first:
            axis.set_ylabel("share of the runs", fontsize=FONT, labelpad=2)
    return figure
