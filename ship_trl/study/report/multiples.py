"""Small multiples: a figure of many small panels that share their axes, laid out in inches.

Nothing is fitted by a solver: the same panels lie at the same places, and a figure of forty is drawn in a
second.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ship_trl.study.report.figures import FONT, Form, plain
from ship_trl.study.report.panels import Panel, Section

# In inches: at the left for the numbers, at the right, between columns, within a stack, under a row of
# panels for its numbers, a line of a legend, a heading.
LEFT, RIGHT, BETWEEN, WITHIN, BELOW, LINE, HEADING = 0.57, 0.12, 0.14, 0.1, 0.24, 0.145, 0.26
TOP, LABEL = 0.08, 0.2


@dataclass(frozen=True)
class Placed:
    """A panel and its axes, from above; whether it is the first of its row."""

    panel: Panel
    axes: list[Axes]
    first: bool


def rows_of(sections: Sequence[Section], columns: int) -> Iterator[tuple[str, list[Panel]]]:
    """Yield rows of at most so many panels, each with the heading that it begins, or none."""
    for section in sections:
        for k in range(0, len(section.panels), columns):
            yield ("" if k else section.heading), list(section.panels[k : k + columns])


def lay_out(
    form: Form,
    sections: Sequence[Section],
    columns: int,
    heights: Sequence[float],
    names: Callable[[Panel], int],
    below: str,
    handles: Sequence[Artist] = (),
) -> tuple[Figure, list[Placed]]:
    """Make a figure with a stack of axes for each panel, and a legend of all of them under it.

    Args:
        form: how wide the figure is.
        sections: the panels; each begins a row under its heading.
        columns: at most so many panels stand beside each other.
        heights: of each panel's axes, from above, in inches.
        names: how many lines a panel's own legend has.
        below: what the lowest axes show to the right.
        handles: of the legend.
    """
    rows = list(rows_of(sections, columns))
    across = max(len(panels) for _, panels in rows)
    width = (form.width - LEFT - RIGHT - (across - 1) * BETWEEN) / across
    legend_columns = 2 if form.narrow else max(1, len(handles))
    foot = LABEL + (0.1 + 0.17 * -(-len(handles) // legend_columns) if handles else 0.0)
    tops, depth = [], TOP
    for heading, panels in rows:
        depth += (HEADING + heading.count("\n") * 0.18 if heading else 0.0) + LINE * max(map(names, panels))
        tops.append(depth)
        depth += sum(heights) + WITHIN * (len(heights) - 1) + BELOW
    total = depth + foot
    figure = Figure(figsize=(form.width, total), dpi=form.dpi)
    placed = []
    for (heading, panels), top in zip(rows, tops, strict=True):
        if heading:
            above = top - LINE * max(map(names, panels)) - 0.07
            figure.text(
                0.08 / form.width, 1 - above / total, heading, fontsize=FONT + 1, weight="bold", va="bottom"
            )
        for column, panel in enumerate(panels):
            left, upper, axes = LEFT + column * (width + BETWEEN), top, []
            for k, height in enumerate(heights):
                box = (
                    left / form.width,
                    1 - (upper + height) / total,
                    width / form.width,
                    height / total,
                )
                axis = figure.add_axes(box)
                plain(axis, left=column == 0, below=k == len(heights) - 1)
                axes.append(axis)
                upper += height + WITHIN
            placed.append(Placed(panel, axes, column == 0))
    middle = (LEFT + form.width - RIGHT) / 2 / form.width
    figure.text(middle, (foot - LABEL + 0.06) / total, below, fontsize=FONT, ha="center", va="bottom")
    if handles:
        figure.legend(
            handles=list(handles),
            loc="lower center",
            ncols=legend_columns,
            fontsize=FONT,
            frameon=False,
            handlelength=2.0,
            columnspacing=1.2,
            borderaxespad=0.1,
        )
    return figure, placed
