"""Learning curves of several groups of runs beside each other: middle and spread over seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import replacing
from ship_trl.view.curve import MEAN_OVER

# Okabe and Ito; the dashes tell lines apart without colour.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")
# Collisions cost 300 and more; what is above this tells policies that reach the goal apart.
LOWEST = -100.0
# Inches of a panel, its legend among them, and panels beside each other: more would not be read on a screen.
WIDTH, HEIGHT, DOTS = 5.2, 6.4, 100
COLUMNS = 3
# Letters that fit beside each other in a legend; an entry takes so many more for its line.
LETTERS, SAMPLE = 84, 9


@dataclass(frozen=True)
class Curve:
    """One run: returns of its training episodes [E], greedy returns [G] after `episodes` [G]."""

    returns: NDArray[np.float64]
    episodes: NDArray[np.int64]
    greedy: NDArray[np.float64]


Groups = Mapping[str, Sequence[Curve]]


def draw_comparison(path: Path, panels: Mapping[str, Groups], best: Mapping[str, float]) -> None:
    """Write a PNG with a panel for each pair, `COLUMNS` in a row: training return above, greedy return below.

    The legend of a panel lies below it, so that it covers no line.

    Args:
        path: where it goes; written beside and renamed.
        panels: title of a panel, names of its groups, runs of each group (one a seed).
        best: the best known return, by panel.

    Raises:
        OSError: the file cannot be written.
    """
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows), dpi=DOTS, layout="constrained")
    places = figure.subfigures(rows, columns, squeeze=False).flat
    for place, (title, groups) in zip(places, panels.items(), strict=False):
        _draw_panel(place, title, groups, best[title])
    with replacing(path) as draft:
        figure.savefig(draft, format="png")


def _draw_panel(place: SubFigure, title: str, groups: Groups, best: float) -> None:
    upper, lower = place.subplots(2, 1, sharex=True)
    upper.set_title(title, parse_math=False)
    for k, (name, curves) in enumerate(groups.items()):
        style = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}
        length = min(len(c.returns) for c in curves)
        smooth = moving_mean(np.stack([c.returns[:length] for c in curves]), MEAN_OVER)
        _draw_band(upper, np.arange(1, length + 1), smooth, f"{name} ({counted(len(curves))})", style)
        count = min(len(c.greedy) for c in curves)
        greedy = np.stack([c.greedy[:count] for c in curves])
        _draw_band(lower, curves[0].episodes[:count], greedy, name, style)
    for axis in (upper, lower):
        axis.axhline(best, color="#7A7A7A", linewidth=1, label=f"best known: {best:.1f}")
        axis.grid(color="#E4E4E4", linewidth=0.8)
        axis.spines[["top", "right"]].set_visible(False)
    lower.set_ylim(LOWEST, best + 15)
    lower.set_xlabel("training episodes")
    upper.set_ylabel(f"training return, mean of {MEAN_OVER}\n(middle seed; band: all)")
    lower.set_ylabel("greedy return\n(middle seed; band: all)")
    lines, names = upper.get_legend_handles_labels()
    beside = max(1, LETTERS // (max(map(len, names)) + SAMPLE))
    place.legend(lines, names, loc="outside lower center", ncols=beside, fontsize=8, frameon=False)


def counted(seeds: int) -> str:
    """Count seeds in words."""
    return "1 seed" if seeds == 1 else f"{seeds} seeds"


def _draw_band(
    axes: Axes, x: NDArray[np.int64], values: NDArray[np.float64], name: str, style: Mapping[str, str]
) -> None:
    """Median over seeds, and all of them as a band: values [S, N]."""
    axes.plot(x, np.median(values, axis=0), label=name, linewidth=1.8, **style)  # type: ignore[arg-type]
    axes.fill_between(x, values.min(axis=0), values.max(axis=0), color=style["color"], alpha=0.15, lw=0)
