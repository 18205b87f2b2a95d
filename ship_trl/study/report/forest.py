"""A forest plot: the gain of each arm in greedy returns, as a share of what could be gained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ship_trl.study.compare import gain
from ship_trl.study.metrics import measure
from ship_trl.study.plan import CONTROL_ARMS, FE, FT, PAIRS, WHOLE, rivals, scratch_place
from ship_trl.study.report.panels import pair_title
from ship_trl.study.report.style import BLUE, BROWN, DPI, FONT, GREY, NARROW, PALE, SMALL, style_axis
from ship_trl.study.statistics import TOLERANCE, Estimate, interquartile_mean
from ship_trl.study.study import Places, Study, pairs, places_of

METRIC = "greedy area"
TITLE = "Gain in greedy returns, as a share of what could be gained"
ARMS = (*FE, *FT, WHOLE, *CONTROL_ARMS)
# Arms between groups of rows, and the share of a row by which own layers lie lower.
GROUP_ENDS, SHIFT = (FE[-1], FT[-1], WHOLE), 0.3
# Shares beyond which an interval is cut off.
LEAST, MOST = -1.25, 1.25
Mark = dict[str, Any]
ARM: Mark = {"color": BLUE, "marker": "o", "markersize": 5, "linewidth": 1.6}
CONTROL: Mark = ARM | {"color": BROWN, "marker": "s", "markersize": 4}
OWN: Mark = {"color": GREY, "marker": "o", "markersize": 3, "markerfacecolor": "white", "linewidth": 0.6}
# Inches of a row's height, and panels in a row of a wide figure.
ROW, COLUMNS = 0.24, 3
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
        possible = 1 - float(interquartile_mean(np.array([measure(run, METRIC) for run in runs])))
        if possible > TOLERANCE and (gains := shares(study, places[pair], possible)):
            _, target = study.cases(pair)
            own = shares(study, places.get(f"{target} to {target}", {}), possible)
            title = f"{pair_title(study, pair)}\ncould be gained: {possible:+.2f}"
            forests.append(Forest(title, gains, own))
    return forests


def shares(study: Study, places: Places, possible: float) -> dict[str, Estimate]:
    """Return the gains of arms as shares of what could be gained, in the order of their rows."""
    found = {}
    for arm in (*ARMS, *rivals(places)):
        if arm in places and (one := gain(study, places[arm], scratch_place(*places[arm][:2]), METRIC)):
            value, low, high = (number / possible for number in (one.value, one.low, one.high))
            found[arm] = replace(one, value=value, low=low, high=high)
    return found


def draw_forest(study: Study, width: float) -> Figure | None:
    """Draw the gains of all pairs beside each other, or in a narrow figure below each other."""
    forests = measure_forests(study)
    if not forests:
        return None
    named = dict.fromkeys(arm for one in forests for arm in one.gains)
    rows = [*(arm for arm in ARMS if arm in named), *rivals(named)]
    columns = 1 if width == NARROW else min(COLUMNS, len(forests))
    lines = -(-len(forests) // columns)
    margin = study.claims.margin
    handles, note = legend(forests, margin), fill(describe(forests, margin), int(NOTE_LETTERS * width))
    foot = 0.16 * (note.count("\n") + 2 + (len(handles) if width == NARROW else 1))
    height = lines * (ROW * len(rows) + 0.6) + 0.4 + foot
    figure = Figure((width, height), dpi=DPI[width], layout="constrained")
    figure.suptitle(
        fill(TITLE, int(TITLE_LETTERS * width)), x=0.005, ha="left", fontsize=FONT + 1, weight="bold"
    )
    axes = [*figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).flat]
    for axis in axes[len(forests) :]:
        axis.remove()
    ends = [(g.low, g.value, g.high) for one in forests for g in (*one.gains.values(), *one.own.values())]
    finite = np.concatenate([np.ravel(ends)[np.isfinite(np.ravel(ends))], [0.0, 1.0]])
    limits = max(LEAST, finite.min()) - 0.05, min(MOST, finite.max()) + 0.05
    for axis, one in zip(axes, forests, strict=False):
        draw_panel(axis, one, rows, margin)
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


def draw_panel(axis: Axes, forest: Forest, rows: Sequence[str], share: float | None) -> None:
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


def legend(forests: Sequence[Forest], margin: float | None) -> list[Line2D | Patch]:
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


def describe(forests: Sequence[Forest], margin: float | None) -> str:
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
