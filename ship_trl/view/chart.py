"""Style the axes and legends of matplotlib charts, and save figures."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ship_trl.files.disk import atomic_write
from ship_trl.view.palette import GRID


def tidy(axes: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Draw a grid behind the lines, and remove the frame above and right of them."""
    axes.grid(axis=grid, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def add_legend(figure: Figure, axes: Iterable[Axes], place: str, columns: int, letters: float) -> None:
    """Add a legend of the lines in `axes` below all axes, each label once; `letters` in points."""
    found = (zip(*reversed(one.get_legend_handles_labels()), strict=True) for one in axes)
    entries = dict(chain.from_iterable(found))
    style: dict[str, Any] = {
        "loc": f"outside lower {place}",
        "ncols": columns,
        "frameon": False,
        "fontsize": letters,
    }
    figure.legend(list(entries.values()), list(entries), **style)


def save(figure: Figure, path: Path) -> None:
    """Write a PNG atomically."""
    with atomic_write(path) as draft:
        # Leave out the version of Matplotlib, so that the same figure gives the same bytes.
        figure.savefig(draft, format="png", metadata={"Software": None})
