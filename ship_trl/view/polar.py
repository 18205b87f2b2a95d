"""Maps of where target ships start that a policy fails to avoid, own ship in the middle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from ship_trl.sim.scene import ship_outline
from ship_trl.view.style import BLACK, CHART, OTHERS, save_figure

# Inches of the page, of a row of maps and of the legend; pixels an inch. At half its size letters of 8 points
# have 11 pixels.
WIDTH, ROW, LEGEND, DPI = 6.4, 2.55, 0.6, 200
# Shares of failures at which the colour changes, and the colours, none first.
ENDS = (0.0, 1e-9, 0.01, 0.05, 0.2, 0.5, 1.0)
COLOURS = ("#E3E9EF", "#FBE08A", "#F9A646", "#EA5B2B", "#B3132B", "#4A0D2B")


@matplotlib.rc_context(CHART)
def draw_failures(path: Path, policies: Mapping[str, pd.DataFrame], sector: float, ring: float) -> None:
    """Write a PNG with a row for each policy, and in it a map for each band of speeds.

    Args:
        path: of the PNG.
        policies: by the title of its row a table of scenes: `speed`, a band as text; the middle of the cell,
            `bearing` (degrees, clockwise from ahead) and `range` (m); `failed`.
        sector: width of the cells (degrees).
        ring: their depth (m).
    """
    figure = Figure(figsize=(WIDTH, ROW * len(policies) + LEGEND), dpi=DPI)
    rows = figure.subfigures(len(policies), 1, squeeze=False)[:, 0]
    colours, norm = ListedColormap(COLOURS), BoundaryNorm(ENDS, len(COLOURS))
    theta = np.radians(np.arange(-sector / 2, 360, sector))
    for place, (title, scenes) in zip(rows, policies.items(), strict=True):
        place.suptitle(title, fontsize=10, fontweight="bold")
        bands = sorted(scenes["speed"].unique())
        limits = np.arange(0, scenes["range"].max() + ring, ring)
        maps = place.subplots(1, len(bands), squeeze=False, subplot_kw={"projection": "polar"})[0]
        for axes, band in zip(maps, bands, strict=True):
            some = scenes[scenes["speed"] == band]
            share = some.pivot_table("failed", "range", "bearing", "mean")
            share = share.reindex(index=limits[:-1] + ring / 2, columns=np.arange(0, 360, sector))
            axes.set(theta_zero_location="N", theta_direction=-1)
            axes.grid(visible=False)
            axes.pcolormesh(theta, limits, share, cmap=colours, norm=norm, edgecolors="white", linewidth=0.4)
            hull = [(-y, x) for x, y in ship_outline(1.0)]
            axes.scatter(0, 0, s=60, marker=hull, color=BLACK, zorder=3)
            axes.spines["polar"].set_color(OTHERS)
            axes.set_title(f"{band} of own speed", fontsize=9, pad=3)
            axes.set_xticks([])
            axes.set_yticks([])
            for metres in limits[2::2]:
                told = axes.text(math.pi, metres, f"{metres:g} m", fontsize=8, ha="center", va="center")
                told.set_path_effects([Stroke(linewidth=2, foreground="white"), Normal()])
    entries = [
        Patch(color=colour, label=f"{low:.0%} to {high:.0%}" if low >= 0.01 else f"up to {high:.0%}")
        for colour, low, high in zip(COLOURS[1:], ENDS[1:], ENDS[2:], strict=False)
    ]
    entries.insert(0, Patch(color=COLOURS[0], label="none"))
    figure.legend(
        handles=entries,
        loc="outside lower center",
        ncols=len(entries),
        fontsize=8,
        handlelength=1,
        columnspacing=1.2,
        title="Failures by where the target ship starts, own ship in the middle, and by its speed",
        title_fontsize=8,
    )
    save_figure(figure, path)
