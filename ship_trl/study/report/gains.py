"""What transfer gains over scratch: maps by source and target, a forest plot, and how alike layers stay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ship_trl.study.claims import Claims
from ship_trl.study.compare import gain
from ship_trl.study.metrics import measure
from ship_trl.study.plan import CONTROL_ARMS, FE, FT, NEW_CASE, PAIRS, SCRATCH, WHOLE, rivals, scratch_place
from ship_trl.study.report.style import (
    BLUE,
    BROWN,
    DASHED,
    DOTTED,
    DPI,
    FONT,
    GREY,
    NARROW,
    PALE,
    REUSED_NAMES,
    SMALL,
    Look,
    cases_of,
    draw_curves,
    legend_above,
    look_of,
    pair_title,
    style_axis,
)
from ship_trl.study.statistics import TOLERANCE, Estimate, interquartile_mean
from ship_trl.study.study import Places, Study, pairs, places_of
from ship_trl.study.tables import OTHER_SEED, SOURCE, UNTRAINED, Layer

MAP_ARMS = (*FE, *CONTROL_ARMS, *FT, WHOLE)
TITLES = {"area": "Gain in training returns", "greedy area": "Gain in greedy returns"}
POSSIBLE = "could be\ngained"
# Inches of a cell's height; columns of a map, and letters in a line, by the width of the figure.
CELL, MAP_COLUMNS, NARROW_COLUMNS, LETTERS_PER_INCH = 0.34, 8, 3, 14
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
        ordered = [*(arm for arm in MAP_ARMS if arm in names), *rivals(names)] or [*names]
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
            and (name == NEW_CASE or row in MAP_ARMS or rivals([row]))
            and (found := gain(study, place, scratch_place(*place[:2]), metric))
        }
        if column:
            columns[f"{source} to {target}" if is_pair else name] = column
    return columns


def split_maps(claims: Claims, columns: dict[str, Column], metric: str, width: float) -> list[Map]:
    """Split columns into maps; the new case has its own map, because its rows are sources."""
    names = [name for name in columns if name != NEW_CASE]
    step = NARROW_COLUMNS if width == NARROW else MAP_COLUMNS
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
    note = fill(describe_map(seeds, any(one.possible for one in maps)), int(LETTERS_PER_INCH * width))
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


def describe_map(seeds: int, has_possible: bool) -> str:
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


FOREST_METRIC = "greedy area"
FOREST_TITLE = "Gain in greedy returns, as a share of what could be gained"
FOREST_ARMS = (*FE, *FT, WHOLE, *CONTROL_ARMS)
# Arms between groups of rows, and the share of a row by which own layers lie lower.
GROUP_ENDS, SHIFT = (FE[-1], FT[-1], WHOLE), 0.3
# Shares beyond which an interval is cut off.
LEAST, MOST = -1.25, 1.25
Mark = dict[str, Any]
ARM: Mark = {"color": BLUE, "marker": "o", "markersize": 5, "linewidth": 1.6}
CONTROL: Mark = ARM | {"color": BROWN, "marker": "s", "markersize": 4}
OWN: Mark = {"color": GREY, "marker": "o", "markersize": 3, "markerfacecolor": "white", "linewidth": 0.6}
# Inches of a row's height, and panels in a row of a wide figure.
ROW, FOREST_COLUMNS = 0.24, 3
# Letters in an inch of the note and of the title.
NOTE_LETTERS, TITLE_LETTERS = 17, 12


@dataclass(frozen=True)
class Forest:
    """Gains of a pair by arm, and those of the target's own layers, as shares of what could be gained."""

    title: str
    gains: Mapping[str, Estimate]
    own: Mapping[str, Estimate]


def measure_forests(study: Study) -> list[Forest]:
    """Return a forest for each pair whose runs from scratch leave something to gain.

    What could be gained is the best known return in every greedy evaluation, less the mean of scratch. The
    error of that mean is not carried on.
    """
    places, forests = places_of(study), []
    for pair in pairs(study):
        runs = study.arm(*scratch_place(PAIRS, pair)).values()
        if not runs:
            continue
        possible = 1 - float(interquartile_mean(np.array([measure(run, FOREST_METRIC) for run in runs])))
        if possible > TOLERANCE and (gains := shares(study, places[pair], possible)):
            _, target = study.cases(pair)
            own = shares(study, places.get(f"{target} to {target}", {}), possible)
            title = f"{pair_title(study, pair)}\ncould be gained: {possible:+.2f}"
            forests.append(Forest(title, gains, own))
    return forests


def shares(study: Study, places: Places, possible: float) -> dict[str, Estimate]:
    """Return the gains of arms as shares of what could be gained, in the order of their rows."""
    found = {}
    for arm in (*FOREST_ARMS, *rivals(places)):
        if arm in places and (
            one := gain(study, places[arm], scratch_place(*places[arm][:2]), FOREST_METRIC)
        ):
            value, low, high = (number / possible for number in (one.value, one.low, one.high))
            found[arm] = replace(one, value=value, low=low, high=high)
    return found


def draw_forest(study: Study, width: float) -> Figure | None:
    """Draw the gains of all pairs beside each other, or in a narrow figure below each other."""
    forests = measure_forests(study)
    if not forests:
        return None
    named = dict.fromkeys(arm for one in forests for arm in one.gains)
    rows = [*(arm for arm in FOREST_ARMS if arm in named), *rivals(named)]
    columns = 1 if width == NARROW else min(FOREST_COLUMNS, len(forests))
    lines = -(-len(forests) // columns)
    margin = study.claims.margin
    handles, note = (
        forest_legend(forests, margin),
        fill(describe_forest(forests, margin), int(NOTE_LETTERS * width)),
    )
    foot = 0.16 * (note.count("\n") + 2 + (len(handles) if width == NARROW else 1))
    height = lines * (ROW * len(rows) + 0.6) + 0.4 + foot
    figure = Figure((width, height), dpi=DPI[width], layout="constrained")
    figure.suptitle(
        fill(FOREST_TITLE, int(TITLE_LETTERS * width)), x=0.005, ha="left", fontsize=FONT + 1, weight="bold"
    )
    axes = [*figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).flat]
    for axis in axes[len(forests) :]:
        axis.remove()
    ends = [(g.low, g.value, g.high) for one in forests for g in (*one.gains.values(), *one.own.values())]
    finite = np.concatenate([np.ravel(ends)[np.isfinite(np.ravel(ends))], [0.0, 1.0]])
    limits = max(LEAST, finite.min()) - 0.05, min(MOST, finite.max()) + 0.05
    for axis, one in zip(axes, forests, strict=False):
        draw_rows(axis, one, rows, margin)
        axis.set(xlim=limits, ylim=(len(rows) - 0.4, -0.6))
        axis.tick_params(labelbottom=True)
    figure.legend(
        handles=handles,
        title=note,
        title_fontsize=SMALL,
        fontsize=SMALL,
        loc="outside lower left",
        ncols=1 if width == NARROW else len(handles),
        alignment="left",
        frameon=False,
        borderaxespad=0.2,
    )
    return figure


def draw_rows(axis: Axes, forest: Forest, rows: Sequence[str], share: float | None) -> None:
    """Draw the gains of a pair, an arm a row, from the top down, over the band of the margin's share."""
    style_axis(axis)
    axis.grid(visible=False, axis="y")
    if share is not None:
        axis.axvspan(-share, share, color=PALE, alpha=0.6, linewidth=0)
    axis.axvline(0, color="black", linewidth=0.8)
    axis.axvline(1, color="black", linewidth=0.8, linestyle="--")
    for row, arm in enumerate(rows):
        if arm in GROUP_ENDS and row < len(rows) - 1:
            axis.axhline(row + 0.5 + SHIFT / 2, color=GREY, linewidth=0.3)
        if own := forest.own.get(arm):
            draw_gain(axis, own, row + SHIFT, OWN)
        if found := forest.gains.get(arm):
            draw_gain(axis, found, row, CONTROL if arm in CONTROL_ARMS else ARM)
    axis.set_title(forest.title, fontsize=FONT, loc="left")
    axis.set_yticks(range(len(rows)), rows)
    axis.tick_params(labelsize=FONT, axis="y")


def draw_gain(axis: Axes, found: Estimate, height: float, mark: Mark) -> None:
    """Draw a gain with its interval, where it has one."""
    ends = [found.low, found.high]
    if np.isfinite(ends).all():
        axis.plot(ends, [height, height], color=mark["color"], linewidth=mark["linewidth"])
    axis.plot([found.value], [height], **mark)


def forest_legend(forests: Sequence[Forest], margin: float | None) -> list[Line2D | Patch]:
    """Return what the legend shows: markers, the band, and the line at all that could be gained."""
    has_controls = any(arm in CONTROL_ARMS for one in forests for arm in one.gains)
    own = [Line2D([], [], label="own layers: the source is the target case", **OWN)]
    best = Line2D([], [], color="black", linewidth=0.8, linestyle="--", label="all that could be gained")
    words = f"\N{PLUS-MINUS SIGN}{100 * (margin or 0):g} % of that"
    band = [] if margin is None else [Patch(color=PALE, alpha=0.6, label=words)]
    return [
        Line2D([], [], label="arm", **ARM),
        *([Line2D([], [], label="control", **CONTROL)] if has_controls else []),
        *(own if any(one.own for one in forests) else []),
        best,
        *band,
    ]


def describe_forest(forests: Sequence[Forest], margin: float | None) -> str:
    """Explain the numbers of the plot."""
    words = (
        "Area under the curve of greedy evaluations less that of scratch, with its 95 % interval. At 0 an "
        "arm is level with scratch; at 1 every evaluation, also the one before training, has the best known "
        "return."
    )
    if margin is not None:
        words += " The plan has no margin for greedy returns: the band is the share that it takes of others."
    seeds = sorted({found.seeds for one in forests for found in one.own.values()})
    if seeds:
        count = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
        words += f" Own layers have {count} seeds; an interval of few may be far too narrow or too wide."
    return words


# Words and look of each arm and the network that it is compared with; lines of scratch are black.
COMPARED = {
    (WHOLE, SOURCE): ("FTW and its source", look_of(WHOLE)),
    (SCRATCH, OTHER_SEED): ("scratch and another seed", look_of(SCRATCH)),
    (SCRATCH, SOURCE): ("scratch and the source", Look(look_of(SCRATCH).colour, DASHED)),
    (SCRATCH, UNTRAINED): ("scratch and random weights", Look(look_of(SCRATCH).colour, DOTTED)),
}


def by_seed(rows: list[Layer], layers: list[str]) -> np.ndarray:
    """Return CKA by seed and layer [S, L], for the seeds that have all layers."""
    import pandas as pd

    table = pd.DataFrame(rows, columns=Layer._fields).pivot(index="seed", columns="layer", values="cka")
    return table.reindex(columns=layers).dropna().to_numpy()


def draw_layers(study: Study, width: float) -> Figure | None:
    """Draw a panel for each pair; None where no layers were measured."""
    known = [pair for pair in pairs(study) if any(row.pair == pair for row in study.layers)]
    if not known:
        return None
    layers = list(dict.fromkeys(row.layer for row in study.layers))
    columns = 1 if width == NARROW else max(3, len(known))
    rows = -(-len(known) // columns)
    figure = Figure(figsize=(width, 2.5 * rows), dpi=DPI[width], layout="constrained")
    for k, pair in enumerate(known):
        axis = figure.add_subplot(rows, columns, k + 1)
        names, least = [], 0.0
        for compared, (words, look) in COMPARED.items():
            found = [row for row in study.layers if (row.pair, row.arm, row.beside) == (pair, *compared)]
            curves = by_seed(found, layers)
            if len(curves):
                low, _ = draw_curves(axis, np.arange(len(layers)), curves, look)
                least = min(least, low)
                names.append((f"{words} ({len(curves)})", look))
        style_axis(axis)
        legend_above(axis, names)
        axis.set_xticks(range(len(layers)), layers)
        axis.set_xlabel(f"pair {pair}, {cases_of(study, pair)}", fontsize=FONT, labelpad=2)
        axis.set_ylim(least - 0.05, 1.05)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
        if k % columns == 0:
            axis.set_ylabel("CKA", fontsize=FONT, labelpad=2)
    return figure
