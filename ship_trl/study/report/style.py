"""How the report's figures look: sizes, the look of each arm, panels, and how they are saved."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray
from PIL import Image

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import atomic_write
from ship_trl.study.compare import SEED
from ship_trl.study.plan import (
    CONTROL_ARMS,
    CONTROL_KINDS,
    FE,
    FT,
    LOW_EPSILON,
    NEW_CASE,
    PAIRS,
    PERMUTED,
    RANDOM,
    SCRATCH,
    SOURCE_CASES,
    TRANSFERS,
    WHOLE,
    Place,
    control_arm,
    rivals,
    scratch_place,
)
from ship_trl.study.statistics import MIN_BAND_SEEDS, band
from ship_trl.study.study import Study, pairs, places_of
from ship_trl.view.style import CHART_SERIES

# Widths in inches, close to the size on the page: a page is at most 75 rem wide, and a screen of 380 pixels
# leaves 348 for a figure.
WIDE, NARROW = 11.0, 3.6
DPI = {WIDE: 110, NARROW: 180}
# Font sizes in points.
FONT, SMALL = 8.0, 7.5
# A curve is a moving mean over this share of its values, drawn at this many points.
SMOOTH, POINTS = 0.05, 150
GREY, PALE = "#6b7280", "#d9dce1"


@dataclass(frozen=True)
class Look:
    """A line's colour and dashes."""

    colour: str
    dashes: Any = "-"


# Colours that colour-blind people can tell apart; in black and white the dashes differ.
BLUE, VERMILION, GREEN, PINK, ORANGE, SKY = CHART_SERIES
BROWN = "#7f5539"
DASHED, DOTTED, DASH_DOTTED = (0, (4, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1))
# The look of every arm. All controls of a kind look alike; networks on the new case are named by source.
LOOKS = {
    SCRATCH: Look("#000000"),
    **{arm: Look(colour) for arm, colour in zip(FE, (BLUE, VERMILION, GREEN, PINK), strict=True)},
    **{arm: Look(colour, DASHED) for arm, colour in zip(FT, (BLUE, VERMILION, GREEN, PINK), strict=True)},
    WHOLE: Look(ORANGE, DASH_DOTTED),
    **{control_arm(arm, RANDOM): Look(SKY, DOTTED) for arm in TRANSFERS},
    **{control_arm(arm, PERMUTED): Look(BROWN, DASH_DOTTED) for arm in TRANSFERS},
    **dict.fromkeys(("reused, low", "reused, 1"), Look(ORANGE, DASH_DOTTED)),
    **{f"case {k}": Look(colour) for k, colour in ((1, BLUE), (3, GREEN), (5, SKY))},
    **{f"case {k}": Look(colour, DASHED) for k, colour in ((2, VERMILION), (4, PINK), (6, BROWN))},
}


# Other methods of transfer by the letters that their arms begin with.
OTHER_LOOKS = {"FE": SKY, "FT": BROWN, "GU": BLUE, "SP": VERMILION, "G": GREEN, "QD": PINK, "QR": ORANGE}


def look_of(arm: str) -> Look:
    """Return the look of an arm; unknown ones are grey."""
    colours = (colour for prefix, colour in OTHER_LOOKS.items() if arm.startswith(prefix))
    return LOOKS.get(arm) or Look(next(colours, GREY), DOTTED)


def points(count: int) -> NDArray[np.int64]:
    """Return up to `POINTS` evenly spaced indices, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, POINTS)).round().astype(np.int64))


def smooth(curves: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return `points` [T] up to the end of the shortest of S curves, and the moving means there [S, T]."""
    length = min(map(len, curves))
    shown = points(length)
    means = moving_mean(np.stack([curve[:length] for curve in curves]), max(1, round(SMOOTH * length)))
    return shown, means[:, shown]


def draw_curves(axis: Axes, x: NDArray[Any], curves: NDArray[np.float64], look: Look) -> tuple[float, float]:
    """Draw seeds [S, T] as interquartile mean and band, few seeds as thin lines; return their range."""
    if len(curves) < MIN_BAND_SEEDS:
        for row in curves:
            axis.plot(x, row, color=look.colour, linestyle=look.dashes, linewidth=0.6)
        return float(curves.min()), float(curves.max())
    # Each line has its own generator, so it does not depend on what else is drawn.
    middle, low, high = band(curves, np.random.default_rng(SEED))
    axis.fill_between(x, low, high, color=look.colour, alpha=0.18, linewidth=0)
    axis.plot(x, middle, color=look.colour, linestyle=look.dashes, linewidth=1.3)
    return float(low.min()), float(high.max())


def set_range(axes: Sequence[Axes], ranges: Sequence[tuple[float, float]], below: float = 0.0) -> None:
    """Give axes the same range of values; `below` is the share of free room below them."""
    least, most = min(low for low, _ in ranges), max(high for _, high in ranges)
    room = 0.05 * (most - least) or 0.1
    for axis in axes:
        axis.set_ylim(least - room - below * (most - least), most + room)
        axis.locator_params(axis="y", nbins=4)


def set_episodes(axis: Axes, end: float) -> None:
    """Set a horizontal axis from 0 to an end; its outer tick labels do not touch those of other panels."""
    axis.set_xlim(0, end)
    axis.set_xticks([0, end / 2, end], [f"{value:g}" for value in (0, end / 2, end)])
    sides: tuple[Literal["left", "center", "right"], ...] = ("left", "center", "right")
    for label, side in zip(axis.get_xticklabels(), sides, strict=False):
        label.set_horizontalalignment(side)


def style_axis(axis: Axes) -> None:
    """Give an axis a light grid and small tick labels."""
    axis.grid(color="#8888", linewidth=0.4)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=SMALL, length=2, pad=2)


def legend_above(axis: Axes, looks: Sequence[tuple[str, Look]]) -> None:
    """Draw a panel's legend above it, with one line in each row."""
    handles = [
        axis.plot([], [], color=look.colour, linestyle=look.dashes, linewidth=1.5, label=name)[0]
        for name, look in looks
    ]
    axis.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        borderaxespad=0.1,
        borderpad=0,
        labelspacing=0.15,
        handlelength=2.0,
        handletextpad=0.5,
        frameon=False,
        fontsize=FONT,
    )


def save(figure: Figure, path: Path) -> list[Path]:
    """Write PNG and PDF to a path without suffix; the same figure gives the same bytes."""
    document = io.BytesIO()
    # Into memory: on a full disk Matplotlib's PDF writer raises a second error that hides the first.
    figure.savefig(document, format="pdf", metadata={"CreationDate": None})
    written = {path.with_suffix(".png"): as_png(figure), path.with_suffix(".pdf"): document.getvalue()}
    for file, data in written.items():
        with atomic_write(file) as draft:
            draft.write_bytes(data)
    return list(written)


def as_png(figure: Figure) -> bytes:
    """Return a figure as PNG of 256 colours, a third of the bytes."""
    drawn, data = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png")
    # An octree keeps the colours of thin lines; other methods mix them with their neighbours.
    few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(data, "png")
    return data.getvalue()


EPSILON = "\N{GREEK SMALL LETTER EPSILON}"
# Names of the reused network in panels.
REUSED_NAMES = {"reused, low": f"reused, {EPSILON} {LOW_EPSILON:g}", "reused, 1": f"reused, {EPSILON} 1"}


@dataclass(frozen=True)
class Trace:
    """A line of a panel."""

    name: str
    place: Place
    look: Look


@dataclass(frozen=True)
class Panel:
    """Some arms, and the runs from scratch that they are compared with."""

    arms: Sequence[Trace]
    scratch: Place


# Panels by the heading above them.
Sections = Mapping[str, Sequence[Panel]]


def pair_title(study: Study, pair: str) -> str:
    """Return the title of a pair's figure, with source and target."""
    return study.claims.title(pair, f"pair {pair}, {cases_of(study, pair)}")


def cases_of(study: Study, pair: str) -> str:
    """Name source and target of a pair."""
    source, target = study.cases(pair)
    return f"{f'case {source} to ' if source else ''}case {target}"


def reuse_title(study: Study) -> str:
    """Return the title of the figure of the new case."""
    return study.claims.title(NEW_CASE, "reuse on the new case")


def make_panels(study: Study, name: str, groups: Sequence[Sequence[str]]) -> list[Panel]:
    """Return a panel for each group of arms of a pair, or of the new case, that has runs."""
    places = places_of(study).get(name, {})
    panels = []
    for group in groups:
        arms = [
            Trace(REUSED_NAMES.get(arm, arm), places[arm], look_of(arm)) for arm in group if arm in places
        ]
        if arms:
            panels.append(Panel(arms, scratch_place(*arms[0].place[:2])))
    return panels


def pair_sections(study: Study, pair: str) -> Sections:
    """Return a panel for each arm with its controls: feature extraction, then finetuning."""
    title, scratch = pair_title(study, pair), scratch_place(PAIRS, pair)
    groups: dict[str, list[tuple[str, ...]]] = {
        "feature extraction": [(arm, *(control_arm(arm, kind) for kind in CONTROL_KINDS)) for arm in FE],
        "finetuning": [(arm,) for arm in (*FT, WHOLE)],
        "other methods": [(arm,) for arm in rivals(places_of(study).get(pair, {}))],
    }
    sections: dict[str, list[Panel]] = {}
    for kind, arms in groups.items():
        if panels := make_panels(study, pair, arms):
            sections[kind if sections else f"{title}\n{kind}"] = panels
    if not sections and study.arm(*scratch):
        return {title: [Panel([], scratch)]}
    return sections


def grouped_sections(study: Study) -> Sections:
    """Return panels of two arms each: a section for each pair, and one for the new case."""
    groups = (FE[:2], FE[2:], FT[:2], FT[2:], (WHOLE,), CONTROL_ARMS)
    sections = {}
    for pair in pairs(study):
        others = [(arm,) for arm in rivals(places_of(study).get(pair, {}))]
        sections[pair_title(study, pair)] = make_panels(study, pair, (*groups, *others))
    sections[reuse_title(study)] = reuse_panels(study, sources_per_panel=2)
    return {heading: panels for heading, panels in sections.items() if panels}


def reuse_panels(study: Study, sources_per_panel: int = 1) -> list[Panel]:
    """Return panels of the new case: the reused network at both starting epsilons, then single sources."""
    names = [f"case {case}" for case in SOURCE_CASES]
    step = sources_per_panel
    groups = [*([name] for name in REUSED_NAMES), *(names[k : k + step] for k in range(0, len(names), step))]
    return make_panels(study, NEW_CASE, groups)


def lay_out(
    width: float,
    sections: Sections,
    columns: int,
    heights: Mapping[str, float],
    label: str,
    handles: Sequence[Artist] = (),
    names: int = 0,
) -> tuple[Figure, list[list[tuple[Panel, Sequence[Axes]]]]]:
    """Make a figure with a stack of axes for each panel.

    Args:
        width: in inches; a narrow figure has two columns.
        sections: each begins a new row under its heading.
        columns: maximum number of panels in a row of a wide figure.
        heights: of each panel's axes in inches, from top to bottom, by the label of their vertical axis.
        label: of the horizontal axes.
        handles: of a legend below all panels.
        names: lines of a panel's legend beside those of its arms.

    Returns:
        The figure, and for each section its panels with their axes from top to bottom.
    """
    columns = 2 if width == NARROW else min(columns, max(map(len, sections.values())))
    counts = [-(-len(panels) // columns) for panels in sections.values()]
    # A section has a heading, and each row has axes, tick labels and a legend.
    tall = []
    for (heading, panels), count in zip(sections.items(), counts, strict=True):
        legend_lines = max(len(panel.arms) for panel in panels) + names
        row = sum(heights.values()) + 0.3 + 0.15 * legend_lines
        tall.append(0.1 + 0.16 * len(heading.splitlines()) + count * row)
    legend_columns = 2 if width == NARROW else max(1, len(handles))
    foot = 0.25 + 0.17 * -(-len(handles) // legend_columns)
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03)
    figure = Figure(figsize=(width, sum(tall) + foot), dpi=DPI[width], layout=layout)
    parts = figure.subfigures(len(sections), 1, squeeze=False, height_ratios=tall)[:, 0]
    drawn = []
    for part, (heading, panels), count in zip(parts, sections.items(), counts, strict=True):
        part.suptitle(heading, x=0.005, ha="left", fontsize=FONT + 1, weight="bold")
        ratios = [*heights.values()] * count
        grid = part.subplots(count * len(heights), columns, squeeze=False, height_ratios=ratios, sharex=True)
        stacks = grid.reshape(count, len(heights), columns).swapaxes(1, 2).reshape(-1, len(heights))
        for axis in stacks[len(panels) :].flat:
            axis.remove()
        for k, axes in enumerate(stacks[: len(panels)]):
            for axis, name in zip(axes, heights, strict=True):
                style_axis(axis)
                axis.tick_params(labelleft=k % columns == 0, labelbottom=axis is axes[-1])
                if k % columns == 0:
                    axis.set_ylabel(name, fontsize=FONT, labelpad=2)
        drawn.append(list(zip(panels, stacks, strict=False)))
    # On the last part, because a label of the whole figure would cover the legend.
    parts[-1].supxlabel(label, fontsize=FONT)
    if handles:
        figure.legend(
            handles=list(handles),
            loc="outside lower center",
            ncols=legend_columns,
            fontsize=FONT,
            frameon=False,
            handlelength=2.0,
            columnspacing=1.2,
        )
    return figure, drawn
