"""Maps of what transfer gains over learning from scratch, by arm, source and target."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ship_trl.study.claims import Claims
from ship_trl.study.compare import gain
from ship_trl.study.plan import CONTROL_ARMS, FE, FT, NEW_CASE, SCRATCH, WHOLE, rivals, scratch_place
from ship_trl.study.report.panels import REUSED_NAMES
from ship_trl.study.report.style import DPI, FONT, NARROW, SMALL
from ship_trl.study.statistics import Estimate
from ship_trl.study.study import Study, pairs, places_of

ARMS = (*FE, *CONTROL_ARMS, *FT, WHOLE)
TITLES = {"area": "Gain in training returns", "greedy area": "Gain in greedy returns"}
POSSIBLE = "could be\ngained"
# Inches of a cell's height; columns of a map, and letters in a line, by the width of the figure.
CELL, COLUMNS, NARROW_COLUMNS, LETTERS_PER_INCH = 0.34, 8, 3, 14
# On this luminance black and white text have the same contrast.
MIDDLE_LUMINANCE = 0.18
# Gains by row.
Column = dict[str, Estimate]


@dataclass(frozen=True)
class Map:
    """Gains by column and row; by column, what could be gained, where that was measured."""

    columns: dict[str, Column]
    possible: dict[str, float]

    @property
    def rows(self) -> list[str]:
        """The rows: arms in their order, or the networks on the new case; last what could be gained."""
        names = dict.fromkeys(row for column in self.columns.values() for row in column)
        ordered = [*(arm for arm in ARMS if arm in names), *rivals(names)] or [*names]
        return [*ordered, POSSIBLE] if self.possible else ordered


def measure_gains(study: Study, metric: str) -> dict[str, Column]:
    """Return the gains of a metric by "source to target" and arm, and those on the new case by network."""
    columns: dict[str, Column] = {}
    for name, places in places_of(study).items():
        is_pair = name in pairs(study)
        source, target = study.cases(name) if is_pair else (name, "")
        column = {
            REUSED_NAMES.get(row, row): found
            for row, place in places.items()
            if place[2] != SCRATCH
            and (name == NEW_CASE or row in ARMS or rivals([row]))
            and (found := gain(study, place, scratch_place(*place[:2]), metric))
        }
        if column:
            columns[f"{source} to {target}" if is_pair else name] = column
    return columns


def split_maps(claims: Claims, columns: dict[str, Column], metric: str, width: float) -> list[Map]:
    """Split columns into maps; the new case has its own map, because its rows are sources."""
    names = [name for name in columns if name != NEW_CASE]
    step = NARROW_COLUMNS if width == NARROW else COLUMNS
    groups = [names[k : k + step] for k in range(0, len(names), step)]
    groups += [[NEW_CASE]] if NEW_CASE in columns else []
    maps = []
    for group in groups:
        # For the new case it was measured from epsilon 1, but most of its networks explore from 0.1.
        of_pairs = [name for name in group if name != NEW_CASE]
        possible = {name: claims.possible_gain(name.split(" to ")[-1], metric) for name in of_pairs}
        known = {name: value for name, value in possible.items() if value}
        maps.append(Map({name: columns[name] for name in group}, known))
    return maps


def draw_gains(study: Study, metric: str, width: float) -> Figure | None:
    """Draw the gains of a metric; None without runs to compare with.

    Both metrics share one colour scale, so their figures can be compared.
    """
    gains = {name: measure_gains(study, name) for name in TITLES}
    maps = split_maps(study.claims, gains[metric], metric, width)
    if not maps:
        return None
    found = [one for columns in gains.values() for column in columns.values() for one in column.values()]
    # Beyond the largest value, because the ends of the scale are too dark to be told apart.
    most = max(0.05, 1.3 * max(abs(one.value) for one in found))
    colours = ScalarMappable(Normalize(-most, most), "PuOr")
    seeds = max(one.seeds for column in gains[metric].values() for one in column.values())
    is_narrow = width == NARROW
    rows = [len(one.rows) for one in maps]
    sizes = [len(one.columns) for one in maps]
    note = fill(describe(seeds, any(one.possible for one in maps)), int(LETTERS_PER_INCH * width))
    height = CELL * (sum(rows) if is_narrow else max(rows)) + 0.35 * (len(maps) if is_narrow else 1)
    figure = Figure((width, height + 0.75 + 0.13 * note.count("\n")), dpi=DPI[width], layout="constrained")
    figure.suptitle(TITLES[metric], x=0.005, ha="left", fontsize=FONT + 1, weight="bold")
    if is_narrow:
        axes = figure.subplots(len(maps), 1, squeeze=False, height_ratios=rows)
    else:
        axes = figure.subplots(1, len(maps), squeeze=False, width_ratios=sizes)
    for axis, one in zip(axes.flat, maps, strict=True):
        draw_map(axis, one, colours, seeds)
        # Cells of all maps have the same size.
        right, bottom = (max(sizes), len(one.rows)) if is_narrow else (len(one.columns), max(rows))
        axis.set(xlim=(-0.5, right - 0.5), ylim=(bottom - 0.5, -0.5))
    shrink = 0.6 if is_narrow else 0.25
    bar = figure.colorbar(
        colours, ax=axes, location="bottom", shrink=shrink, aspect=25, anchor=(0, 1), pad=0.02
    )
    bar.ax.tick_params(labelsize=SMALL, length=2, pad=2)
    bar.set_label(note, fontsize=SMALL, loc="left", labelpad=3, linespacing=1.25, multialignment="left")
    return figure


def describe(seeds: int, has_possible: bool) -> str:
    """Explain the cells of a map."""
    words = (
        "Area under the curve less that of scratch, with its 95 % interval, in scores: 0 is random, 1 "
        "the best known return. Bold: the interval does not hold zero. In brackets: seeds, where fewer than "
        f"{seeds}; an interval of so few may be far too narrow or too wide."
    )
    possible = (
        " Could be gained: the same of a network that has learned the target case already, explores on the "
        "same schedule, and learns no more."
    )
    return words + possible if has_possible else words


def luminance(colour: Any) -> float:
    """Return the relative luminance of an RGBA colour."""
    return float(np.dot((0.2126, 0.7152, 0.0722), np.power(colour[:3], 2.2)))


def draw_map(axis: Axes, shown: Map, colours: ScalarMappable, seeds: int) -> None:
    """Draw cells with their numbers; cells of fewer than `seeds` seeds say how many they have."""
    rows, columns = shown.rows, list(shown.columns)
    values = np.full((len(rows), len(columns)), np.nan)
    for x, name in enumerate(columns):
        for row, found in shown.columns[name].items():
            y = rows.index(row)
            values[y, x] = found.value
            is_dark = luminance(colours.to_rgba(np.array(found.value))) < MIDDLE_LUMINANCE
            style: dict[str, Any] = {"ha": "center", "color": "white" if is_dark else "black"}
            is_bounded = bool(np.isfinite([found.low, found.high]).all())
            weight = "bold" if is_bounded and (found.low > 0 or found.high < 0) else "normal"
            number = f"{found.value:+.2f}" + (f" ({found.seeds})" if found.seeds < seeds else "")
            align = "bottom" if is_bounded else "center"
            axis.text(x, y, number, va=align, fontsize=FONT, weight=weight, **style)
            if is_bounded:
                interval = f"{found.low:+.2f} to {found.high:+.2f}"
                axis.text(x, y + 0.06, interval, va="top", fontsize=SMALL, **style)
        if name in shown.possible:
            text = f"{shown.possible[name]:+.2f}"
            axis.text(x, rows.index(POSSIBLE), text, ha="center", va="center", fontsize=FONT, style="italic")
    axis.imshow(values, cmap=colours.cmap, clim=colours.get_clim(), aspect="auto")
    axis.set_xticks(range(len(columns)), columns)
    axis.set_yticks(range(len(rows)), [row.replace("-", "\n") for row in rows])
    axis.tick_params(labelsize=FONT, length=0, pad=3, top=False, labeltop=True, labelbottom=False)
    axis.spines[:].set_visible(False)
