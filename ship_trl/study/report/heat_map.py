"""A heat map of what transfer gains over learning from scratch, by source, target and arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from ship_trl.study.analysis.measured import above_scratch
from ship_trl.study.analysis.statistics import Estimate, level_of
from ship_trl.study.analysis.study import Place, Study
from ship_trl.study.claims.kinds import FE, FT
from ship_trl.study.plan.config import CONTROL_ARMS, REUSED_ARM, read
from ship_trl.study.plan.jobs import COMPARED, CONTROLS, PAIRS, from_scratch
from ship_trl.study.report.figures import FONT, SMALL, Form
from ship_trl.study.report.panels import pairs, reuse_panels

ARMS = (*FE, *CONTROL_ARMS, *FT, "FTW")
PAIRS_TITLE, NEW_TITLE = "Source to target, by arm", "The new case, by source"
RETURNS = {"area": "training returns", "greedy area": "greedy returns"}
# In inches: edges, a cell's height, a map's heading, a line of the names above its columns, the scale below.
EDGE, CELL, HEADING, TITLE, BAR = 0.12, 0.36, 0.22, 0.15, 0.66
# So many sources stand beside each other on a telephone, at most.
ACROSS = 3


@dataclass(frozen=True)
class Gain(Estimate):
    """What an arm gains, and of how many seeds that is known."""

    seeds: int


Row = dict[str, Gain]


@dataclass(frozen=True)
class Map:
    """Cells by the names of their row and column."""

    title: str
    rows: Sequence[str]
    columns: Sequence[str]
    cells: Mapping[tuple[str, str], Gain]

    @property
    def above(self) -> float:
        """How much stands above the cells, in inches: the title, and the names of the columns."""
        lines = max(name.count("-") + 1 for name in self.columns)
        return (HEADING if self.title else 0.0) + TITLE * lines + 0.05


def rows(study: Study) -> dict[str, tuple[Place, dict[str, Place]]]:
    """Find what is compared: by "source to target", the runs from scratch and those of each arm."""
    found: dict[str, tuple[Place, dict[str, Place]]] = {}
    for pair in pairs(study):
        source, target = study.cases(pair)
        arms: dict[str, Place] = {arm: (PAIRS, pair, arm) for arm in ARMS}
        arms |= {arm: (CONTROLS, pair, arm) for arm in CONTROL_ARMS}
        found[f"{source} to {target}"] = from_scratch(PAIRS, pair), arms
    for label in COMPARED:
        values = read("pair", label)
        # Without controls it may be a pair like others.
        itself: dict[str, Place] = {arm: (CONTROLS, label, arm) for arm in ARMS}
        name = f"{values['source']} to {values['target']}"
        found.setdefault(name, (from_scratch(CONTROLS, label), itself))
    return {
        name: (scratch, arms)
        for name, (scratch, arms) in found.items()
        if study.arm(*scratch) and any(study.arm(*place) for place in arms.values())
    }


def reused(study: Study) -> dict[str, tuple[Place, Place]]:
    """Find what is compared on the new case: by source, the runs from scratch and those that reuse it."""
    return {
        arm.name: (one.scratch, arm.place)
        for one in reuse_panels(study)
        for arm in one.arms
        if study.arm(*one.scratch)
    }


def counted(study: Study, place: Place, scratch: Place, metric: str) -> Gain | None:
    """Return what an arm gains over scratch; None without seeds that both have."""
    differences = above_scratch(study, place, scratch, metric)
    if not len(differences):
        return None
    found = level_of(differences, study.level)
    return Gain(found.value, found.low, found.high, len(differences))


def gains(study: Study, metric: str = "area") -> dict[str, Row]:
    """Return what each arm gains in a metric, by source and target; rows without any are left out."""
    measured = {
        name: {
            arm: found
            for arm in ARMS
            if arm in arms and (found := counted(study, arms[arm], scratch, metric))
        }
        for name, (scratch, arms) in rows(study).items()
    }
    return {name: found for name, found in measured.items() if found}


def draw_gains(study: Study, form: Form, metric: str = "area") -> Figure | None:
    """Draw what is gained on the pairs and, apart, on the new case; None without runs to compare with."""
    table = gains(study, metric)
    alone = {
        name: found
        for name, (scratch, place) in reused(study).items()
        if (found := counted(study, place, scratch, metric))
    }
    maps = maps_of(table, alone, form)
    if not maps:
        return None
    cells = [one for row in (*table.values(), alone) for one in row.values()]
    largest = max(abs(one.value) for one in cells)
    seeds = max(one.seeds for one in cells)
    # The ends of the scale are so dark that nothing near them can be told apart.
    most = max(0.05, 1.3 * largest)
    total = EDGE + BAR + sum(one.above + CELL * len(one.rows) + EDGE for one in maps)
    figure = Figure(figsize=(form.width, total), dpi=form.dpi)
    left, depth = (0.86 if form.narrow else 0.9), EDGE
    for one in maps:
        if one.title:
            title = f"{one.title} ({RETURNS[metric]})"
            figure.text(
                0.08 / form.width, 1 - depth / total, title, fontsize=FONT + 1, weight="bold", va="top"
            )
        depth += one.above
        height = CELL * len(one.rows)
        # A map of few columns has no wider cells than one of many.
        width = min(form.width - left - EDGE, len(one.columns) * 1.3)
        box = (left / form.width, 1 - (depth + height) / total, width / form.width, height / total)
        picture = draw_map(figure.add_axes(box), one, most, seeds)
        depth += height + EDGE
    bar = figure.add_axes((left / form.width, (BAR - 0.3) / total, 2.3 / form.width, 0.1 / total))
    figure.colorbar(picture, cax=bar, orientation="horizontal")
    bar.tick_params(labelsize=SMALL, length=2, pad=2)
    bar.set_title("above scratch (score)", fontsize=FONT, pad=3, loc="left")
    return figure


def draw_greedy_gains(study: Study, form: Form) -> Figure | None:
    """Draw the same of greedy returns."""
    return draw_gains(study, form, "greedy area")


def maps_of(table: Mapping[str, Row], alone: Row, form: Form) -> list[Map]:
    """Return what is drawn: sources are rows on a page, and a few columns on a telephone."""
    maps = []
    arms = [arm for arm in ARMS if any(arm in row for row in table.values())]
    if form.narrow:
        names = list(table)
        for k, group in enumerate(np.array_split(names, -(-len(names) // ACROSS)) if names else []):
            part = {str(name): table[name] for name in group}
            own = [arm for arm in arms if any(arm in row for row in part.values())]
            cells = {(arm, name): found for name, row in part.items() for arm, found in row.items()}
            maps.append(Map("" if k else PAIRS_TITLE, own, list(part), cells))
        if alone:
            cells = {(name, REUSED_ARM): found for name, found in alone.items()}
            maps.append(Map(NEW_TITLE, list(alone), [REUSED_ARM], cells))
        return maps
    if table:
        cells = {(name, arm): found for name, row in table.items() for arm, found in row.items()}
        maps.append(Map(PAIRS_TITLE, list(table), arms, cells))
    if alone:
        cells = {(REUSED_ARM, name): found for name, found in alone.items()}
        maps.append(Map(NEW_TITLE, [REUSED_ARM], list(alone), cells))
    return maps


def luminance(colour: Any) -> float:
    """Return the relative luminance of an RGBA colour; at 0.18 black and white are read alike on it."""
    red, green, blue, _ = colour
    return float(np.dot((0.2126, 0.7152, 0.0722), np.power((red, green, blue), 2.2)))


def draw_map(axis: Axes, shown: Map, most: float, seeds: int) -> AxesImage:
    """Draw cells with their numbers, and the count of seeds where it is smaller than `seeds`.

    Bold is one whose interval does not hold zero.
    """
    scale = mpl.cm.ScalarMappable(Normalize(-most, most), "PuOr").to_rgba
    values = np.full((len(shown.rows), len(shown.columns)), np.nan)
    for (row, column), found in shown.cells.items():
        place = shown.rows.index(row), shown.columns.index(column)
        values[place] = found.value
        colour = "white" if luminance(scale(np.array(found.value))) < 0.18 else "black"
        sure = np.isfinite([found.low, found.high]).all()
        weight = "bold" if sure and (found.low > 0 or found.high < 0) else "normal"
        text: dict[str, Any] = {"ha": "center", "color": colour}
        number = f"{found.value:+.2f}" + (f" ({found.seeds})" if found.seeds < seeds else "")
        axis.text(
            place[1], place[0], number, va="bottom" if sure else "center", fontsize=FONT,
            weight=weight, **text,
        )  # fmt: skip
        if sure:
            between = f"{found.low:+.2f} to {found.high:+.2f}"
            axis.text(place[1], place[0] + 0.06, between, va="top", fontsize=SMALL, **text)
    picture = axis.imshow(values, cmap=mpl.colormaps["PuOr"], vmin=-most, vmax=most, aspect="auto")
    axis.set_xticks(range(len(shown.columns)), [name.replace("-", "\n") for name in shown.columns])
    axis.set_yticks(range(len(shown.rows)), [name.replace("-", "\n") for name in shown.rows])
    axis.tick_params(labelsize=FONT, length=0, pad=3, top=False, labeltop=True, labelbottom=False)
    axis.spines[:].set_visible(False)
    return picture
