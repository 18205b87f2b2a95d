"""What transfer gains over scratch: maps by source and target, a forest plot, and how alike layers stay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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

from ship_trl.study.compare import gain
from ship_trl.study.metrics import measure
from ship_trl.study.plan import CONTROL_ARMS, FE, FT, NEW_CASE, PAIRS, SCRATCH, WHOLE, rivals, scratch_place
from ship_trl.study.report import style
from ship_trl.study.report.curves import cases_of, pair_title
from ship_trl.study.report.opening import RETURN, measure_arms
from ship_trl.study.statistics import TOLERANCE, Estimate, interquartile_mean
from ship_trl.study.study import Places, Study, pairs, places_of
from ship_trl.study.tables import OTHER_SEED, SOURCE, UNTRAINED
from ship_trl.view.style import BLACK, DASHED, DOTTED, GREY, Style, line

MAP_ARMS = (*FE, *CONTROL_ARMS, *FT, WHOLE)
TITLES = {"area": "Gain in training returns", "greedy area": "Gain in greedy returns"}
POSSIBLE = "could be\ngained"
# Inches of a cell's height, and letters in an inch of a note.
CELL, LETTERS = 0.34, 14
# On this luminance black and white text have the same contrast.
MIDDLE_LUMINANCE = 0.18
# Gains by row.
Column = dict[str, Estimate]


def ordered(names: Iterable[str], arms: tuple[str, ...]) -> list[str]:
    """Return those of some arms that are named, then other methods of transfer."""
    known = set(names)
    return [*(arm for arm in arms if arm in known), *rivals(known)]


def gains_of(study: Study, places: Places, rows: Iterable[str], metric: str) -> Column:
    """Return the gains of the arms in some rows."""
    found = {row: gain(study, places[row], scratch_place(*places[row][:2]), metric) for row in rows}
    return {row: one for row, one in found.items() if one is not None}


def measure_gains(study: Study, metric: str) -> dict[str, Column]:
    """Return the gains of a metric by "source to target" and arm, and those on the new case by network."""
    columns: dict[str, Column] = {}
    for name, places in places_of(study).items():
        networks = [row for row, place in places.items() if place[2] != SCRATCH]
        rows = networks if name == NEW_CASE else ordered(places, MAP_ARMS)
        if column := gains_of(study, places, rows, metric):
            words = " to ".join(map(str, study.cases(name))) if name in pairs(study) else name
            columns[words] = {style.REUSED_NAMES.get(row, row): found for row, found in column.items()}
    return columns


def draw_gains(study: Study, metric: str) -> Figure | None:
    """Draw the gains of a metric, the new case in a map of its own; None without runs to compare with.

    Both metrics share one colour scale, so their figures can be compared.
    """
    gains = {name: measure_gains(study, name) for name in TITLES}
    if not gains[metric]:
        return None
    # The rows of the new case are sources, those of the others are arms.
    of_pairs = {name: column for name, column in gains[metric].items() if name != NEW_CASE}
    of_new = {name: column for name, column in gains[metric].items() if name == NEW_CASE}
    maps = [columns for columns in (of_pairs, of_new) if columns]
    # For the new case it was measured from epsilon 1, but most of its networks explore from 0.1.
    possible = {
        name: value
        for name in of_pairs
        if (value := study.claims.possible_gain(name.split(" to ")[-1], metric))
    }
    found = [one for columns in gains.values() for column in columns.values() for one in column.values()]
    # Beyond the largest value, because the ends of the scale are too dark to be told apart.
    most = max(0.05, 1.3 * max(abs(one.value) for one in found))
    colours = ScalarMappable(Normalize(-most, most), "PuOr")
    seeds = max(one.seeds for column in gains[metric].values() for one in column.values())
    rows = []
    for columns in maps:
        named = dict.fromkeys(row for column in columns.values() for row in column)
        arms = ordered(named, MAP_ARMS) if columns is of_pairs else [*named]
        rows.append([*arms, POSSIBLE] if possible.keys() & columns else arms)
    note = (
        "Area under the curve less that of scratch, with its 95 % interval, in scores: 0 is random, 1 "
        "the best known return. Bold: the interval does not hold zero. In brackets: seeds, where fewer than "
        f"{seeds}; an interval of so few may be far too narrow or too wide."
    )
    if possible:
        note += (
            " Could be gained: the same of a network that has learned the target case already, explores on "
            "the same schedule, and learns no more."
        )
    note = fill(note, int(LETTERS * style.WIDTH))
    figure = Figure((style.WIDTH, CELL * max(map(len, rows)) + 1.1 + 0.13 * note.count("\n")))
    figure.suptitle(TITLES[metric], x=0.005, ha="left")
    axes = figure.subplots(1, len(maps), squeeze=False, width_ratios=[*map(len, maps)])[0]
    for axis, columns, names in zip(axes, maps, rows, strict=True):
        draw_map(axis, columns, names, possible, colours, seeds)
        # Cells of all maps have the same size.
        axis.set(xlim=(-0.5, len(columns) - 0.5), ylim=(max(map(len, rows)) - 0.5, -0.5))
    bar = figure.colorbar(
        colours, ax=axes, location="bottom", shrink=0.25, aspect=25, anchor=(0, 1), pad=0.02
    )
    bar.set_label(note, fontsize=style.SMALL, loc="left", labelpad=3, linespacing=1.25, multialignment="left")
    return figure


def luminance(colour: Any) -> float:
    """Return the relative luminance of an RGBA colour."""
    return float(np.dot((0.2126, 0.7152, 0.0722), np.power(colour[:3], 2.2)))


def draw_map(
    axis: Axes,
    columns: Mapping[str, Column],
    rows: list[str],
    possible: Mapping[str, float],
    colours: ScalarMappable,
    seeds: int,
) -> None:
    """Draw cells with their numbers; cells of fewer than `seeds` seeds say how many they have."""
    values = np.full((len(rows), len(columns)), np.nan)
    for x, (name, column) in enumerate(columns.items()):
        for row, found in column.items():
            y = rows.index(row)
            values[y, x] = found.value
            is_dark = luminance(colours.to_rgba(np.array(found.value))) < MIDDLE_LUMINANCE
            form: Style = {"ha": "center", "color": "white" if is_dark else "black"}
            is_bounded = bool(np.isfinite([found.low, found.high]).all())
            weight = "bold" if is_bounded and (found.low > 0 or found.high < 0) else "normal"
            number = f"{found.value:+.2f}" + (f" ({found.seeds})" if found.seeds < seeds else "")
            axis.text(x, y, number, va="bottom" if is_bounded else "center", weight=weight, **form)
            if is_bounded:
                interval = f"{found.low:+.2f} to {found.high:+.2f}"
                axis.text(x, y + 0.06, interval, va="top", fontsize=style.SMALL, **form)
        if name in possible:
            axis.text(x, len(rows) - 1, f"{possible[name]:+.2f}", ha="center", va="center", style="italic")
    axis.imshow(values, cmap=colours.cmap, clim=colours.get_clim(), aspect="auto")
    axis.set_xticks(range(len(columns)), [*columns])
    axis.set_yticks(range(len(rows)), [row.replace("-", "\n") for row in rows])
    axis.tick_params(labelsize=style.FONT, length=0, pad=3, top=False, labeltop=True, labelbottom=False)
    axis.spines[:].set_visible(False)
    axis.grid(visible=False)


FOREST_METRIC = "greedy area"
FOREST_TITLE = "Gain in greedy returns, as a share of what could be gained"
FOREST_ARMS = (*FE, *FT, WHOLE, *CONTROL_ARMS)
# Arms between groups of rows, and the share of a row by which own layers lie lower.
GROUP_ENDS, SHIFT = (FE[-1], FT[-1], WHOLE), 0.3
# Shares beyond which an interval is cut off; an arrow says so.
LEAST, MOST = -1.25, 1.25
BETTER = "better \N{RIGHTWARDS ARROW}"
# Arms have their own colours.
ARM: Style = {"color": GREY, "marker": "o", "markersize": 5, "linewidth": 1.6}
CONTROL: Style = ARM | {"marker": "s", "markersize": 4}
OWN: Style = {
    "color": GREY,
    "marker": "o",
    "markersize": 3,
    "markerfacecolor": "white",
    "linewidth": 0.6,
}
BEST: Style = {"color": "black", "linewidth": 0.8, "linestyle": "--"}
BAND: Style = {"color": style.PALE, "alpha": 0.6, "linewidth": 0}
# Inches of a row's height, panels in a row, and letters in an inch of the note.
ROW, FOREST_COLUMNS, NOTE_LETTERS = 0.24, 3, 17


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


def shares(study: Study, places: Places, possible: float) -> Column:
    """Return the gains of arms as shares of what could be gained, in the order of their rows."""
    found = gains_of(study, places, ordered(places, FOREST_ARMS), FOREST_METRIC)
    for arm, one in found.items():
        value, low, high = (number / possible for number in (one.value, one.low, one.high))
        found[arm] = replace(one, value=value, low=low, high=high)
    return found


def draw_forest(study: Study) -> Figure | None:
    """Draw the gains of all pairs beside each other; None where nothing could be gained."""
    forests = measure_forests(study)
    if not forests:
        return None
    rows = ordered((arm for one in forests for arm in one.gains), FOREST_ARMS)
    columns = min(FOREST_COLUMNS, len(forests))
    lines = -(-len(forests) // columns)
    margin, own = study.claims.margin, [found.seeds for one in forests for found in one.own.values()]
    handles: list[Line2D | Patch] = [Line2D([], [], label="arm", **ARM)]
    if any(arm in CONTROL_ARMS for arm in rows):
        handles.append(Line2D([], [], label="control", **CONTROL))
    note = (
        "Area under the curve of greedy evaluations less that of scratch, with its 95 % interval. At 0 an "
        "arm is level with scratch; at 1 every evaluation, also the one before training, has the best known "
        "return."
    )
    if margin is not None:
        note += " The plan has no margin for greedy returns: the band is the share that it takes of others."
    if own:
        handles.append(Line2D([], [], label="own layers: the source is the target case", **OWN))
        count = f"{min(own)}" if min(own) == max(own) else f"{min(own)} to {max(own)}"
        note += f" Own layers have {count} seeds; an interval of few may be far too narrow or too wide."
    handles.append(Line2D([], [], label="all that could be gained", **BEST))
    if margin is not None:
        handles.append(Patch(label=f"\N{PLUS-MINUS SIGN}{100 * margin:g} % of that", **BAND))
    low, high = ends_of([gain for one in forests for gain in (*one.gains.values(), *one.own.values())])
    if low < LEAST or high > MOST:
        note += " An interval with an arrow goes on beyond the edge."
    limits = max(LEAST, low) - 0.05, min(MOST, max(high, 1.0)) + 0.05
    note = fill(note, int(NOTE_LETTERS * style.WIDTH))
    height = lines * (ROW * len(rows) + 0.75) + 0.4 + 0.16 * (note.count("\n") + 3)
    figure = Figure((style.WIDTH, height))
    figure.suptitle(FOREST_TITLE, x=0.005, ha="left")
    axes = [*figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).flat]
    for axis in axes[len(forests) :]:
        axis.remove()
    for axis, one in zip(axes, forests, strict=False):
        axis.set(xlim=limits, ylim=(len(rows) - 0.4, -0.6))
        draw_rows(axis, one, rows, margin)
        axis.axvline(1, **BEST)
        axis.set_xlabel(BETTER, loc="right")
        axis.tick_params(labelbottom=True)
    form: Style = {"loc": "outside lower left", "alignment": "left", "borderaxespad": 0.2}
    form |= {"title": note, "title_fontsize": style.SMALL, "fontsize": style.SMALL, "ncols": len(handles)}
    figure.legend(handles=handles, **form)
    return figure


def ends_of(found: Iterable[Estimate]) -> tuple[float, float]:
    """Return the least and the largest end of some intervals, and of zero."""
    ends = np.array([0.0, *(end for one in found for end in (one.low, one.value, one.high))])
    finite = ends[np.isfinite(ends)]
    return float(finite.min()), float(finite.max())


def draw_rows(axis: Axes, forest: Forest, rows: list[str], share: float | None) -> None:
    """Draw the gains of a pair, an arm a row, from the top down, over the band of the margin's share."""
    axis.grid(visible=False, axis="y")
    if share is not None:
        axis.axvspan(-share, share, **BAND)
    axis.axvline(0, color="black", linewidth=0.8)
    limits = axis.get_xlim()
    for row, arm in enumerate(rows):
        if arm in GROUP_ENDS and row < len(rows) - 1:
            axis.axhline(row + 0.5 + SHIFT / 2, color=GREY, linewidth=0.3)
        mark = (CONTROL if arm in CONTROL_ARMS else ARM) | {"color": style.look_of(arm)["color"]}
        for gains, height, look in ((forest.own, row + SHIFT, OWN), (forest.gains, row, mark)):
            if found := gains.get(arm):
                ends = [found.low, found.high]
                if np.isfinite(ends).all():
                    axis.plot(ends, [height, height], color=look["color"], linewidth=look["linewidth"])
                    is_cut = ends[0] < limits[0], ends[1] > limits[1]
                    for edge, arrow, cut in zip(limits, "<>", is_cut, strict=True):
                        form: Style = {"color": look["color"], "markersize": 4 * cut, "clip_on": False}
                        axis.plot([edge], [height], arrow, **form)
                axis.plot([found.value], [height], **look)
    axis.set_title(forest.title)
    axis.set_yticks(range(len(rows)), rows, fontsize=style.FONT)


def draw_effects(study: Study) -> Figure | None:
    """Draw how far each arm's greedy return is from scratch's, a panel a pair; None without differences."""
    panels: dict[str, Column] = {}
    for one in measure_arms(study):
        if one.differences:
            panels.setdefault(one.pair, {})[one.arm] = one.differences[RETURN]
    if not panels:
        return None
    low, high = ends_of(one for gains in panels.values() for one in gains.values())
    room = 0.05 * (high - low) or 1.0
    heights = [ROW * len(gains) + 0.3 for gains in panels.values()]
    figure = Figure((style.NARROW, sum(heights) + 0.4), dpi=style.NARROW_DPI)
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True, height_ratios=heights)[:, 0]
    for axis, (name, gains) in zip(axes, panels.items(), strict=True):
        axis.set(xlim=(low - room, high + room), ylim=(len(gains) - 0.4, -0.6))
        draw_rows(axis, Forest(pair_title(study, name), gains, {}), [*gains], None)
    axes[-1].set_xlabel(f"{RETURN} above scratch (points of reward)    {BETTER}")
    return figure


# Words and look of scratch and the network that it is compared with, in black.
COMPARED = {
    (SCRATCH, OTHER_SEED): ("scratch and another seed", style.look_of(SCRATCH)),
    (SCRATCH, SOURCE): ("scratch and the source", line(BLACK, DASHED)),
    (SCRATCH, UNTRAINED): ("scratch and random weights", line(BLACK, DOTTED)),
}


def draw_layers(study: Study) -> Figure | None:
    """Draw a panel for each pair; None where no layers were measured."""
    table = study.layers
    if table is None or table.empty:
        return None
    known, layers = sorted(table["pair"].unique()), table["layer"].unique()
    # All arms of the paper would hide each other: then FTW, which copies every layer, alone.
    arms = [arm for arm in table["arm"].unique() if arm != SCRATCH]
    carried = [WHOLE] if WHOLE in arms else arms
    shown = {(arm, SOURCE): (f"{arm} and its source", style.look_of(arm)) for arm in carried} | COMPARED
    single = len(known) == 1
    figure = Figure((style.NARROW if single else style.WIDTH, 2.5), dpi=style.NARROW_DPI if single else None)
    axes, least = figure.subplots(1, len(known), sharey=True, squeeze=False)[0], 0.0
    for axis, pair in zip(axes, known, strict=True):
        for compared, (words, look) in shown.items():
            rows = table[(table[["pair", "arm", "beside"]] == [pair, *compared]).all(axis=1)]
            # The seeds that have all layers: [S, L].
            by_seed = rows.pivot(index="seed", columns="layer", values="cka").reindex(columns=layers)
            curves = by_seed.dropna().to_numpy()
            if len(curves):
                low, _ = style.draw_curves(
                    axis, np.arange(len(layers)), curves, look, f"{words} ({len(curves)})"
                )
                least = min(least, low)
        style.legend_above(axis)
        axis.set_xticks(range(len(layers)), layers)
        axis.set_xlabel(f"pair {pair}, {cases_of(study, pair)}")
        axis.set_ylim(least - 0.05, 1.05)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    axes[0].set_ylabel("CKA")
    return figure
