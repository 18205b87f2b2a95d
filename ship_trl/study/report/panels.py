"""Figures of many small panels: which arms share a panel, and how panels are laid out at a width."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ship_trl.study.analysis.study import FIGURES, REUSED, SOURCES, Study, pairs, places_of
from ship_trl.study.plan.arms import CONTROL_ARMS, CONTROL_KINDS, FE, FT, WHOLE, control_arm
from ship_trl.study.plan.jobs import LOW_EPSILON, PAIRS, Place, scratch_place
from ship_trl.study.report.style import DPI, FONT, NARROW, Look, look_of, style_axis

REUSE_TITLE = "Figure 9: reuse on the new case"
# Names of the reused network in panels.
EPSILON = "\N{GREEK SMALL LETTER EPSILON}"
REUSED_NAMES = {"reused, low": f"reused, {EPSILON} {LOW_EPSILON:g}", "reused, 1": f"reused, {EPSILON} 1"}


@dataclass(frozen=True)
class Arm:
    """A line of a panel."""

    name: str
    place: Place
    look: Look


@dataclass(frozen=True)
class Panel:
    """Some arms, and the runs from scratch that they are compared with."""

    arms: Sequence[Arm]
    scratch: Place


@dataclass(frozen=True)
class Section:
    """Panels under one heading."""

    heading: str
    panels: Sequence[Panel]


@dataclass(frozen=True)
class Drawn:
    """A panel with its axes from top to bottom."""

    panel: Panel
    axes: Sequence[Axes]


def pair_title(study: Study, pair: str) -> str:
    """Return the title of a pair's figure: the paper's number, source and target."""
    name = f"Figure {FIGURES[pair]}: pair {pair}" if pair in FIGURES else f"Pair {pair}"
    source, target = study.cases(pair)
    return f"{name}, {f'case {source} to ' if source else ''}case {target}"


def make_panels(study: Study, pair: str, groups: Sequence[Sequence[str]]) -> Iterator[Panel]:
    """Yield a panel for each group of arms of a pair that has runs."""
    places = places_of(study)[pair]
    for group in groups:
        arms = [Arm(name, places[name], look_of(name)) for name in group if name in places]
        if arms:
            yield Panel(arms, scratch_place(PAIRS, pair))


def pair_sections(study: Study, pair: str) -> list[Section]:
    """Return panels of one arm each, with its controls: feature extraction, then finetuning."""
    groups: dict[str, Sequence[Sequence[str]]] = {
        "feature extraction": [(arm, *(control_arm(arm, kind) for kind in CONTROL_KINDS)) for arm in FE],
        "finetuning": [(arm,) for arm in (*FT, WHOLE)],
    }
    sections: list[Section] = []
    for heading, arms in groups.items():
        if panels := list(make_panels(study, pair, arms)):
            title = heading if sections else f"{pair_title(study, pair)}\n{heading}"
            sections.append(Section(title, panels))
    scratch = scratch_place(PAIRS, pair)
    if not sections and study.arm(*scratch):
        sections.append(Section(pair_title(study, pair), [Panel([], scratch)]))
    return sections


def grouped_sections(study: Study) -> list[Section]:
    """Return panels of two arms each: a section for each pair, and one for the new case."""
    groups = (FE[:2], FE[2:], FT[:2], FT[2:], (WHOLE,), CONTROL_ARMS)
    sections = [
        Section(pair_title(study, pair), list(make_panels(study, pair, groups))) for pair in pairs(study)
    ]
    sections.append(Section(REUSE_TITLE, reuse_panels(study, sources_a_panel=2)))
    return [section for section in sections if section.panels]


def reuse_panels(study: Study, sources_a_panel: int = 1) -> list[Panel]:
    """Return panels of the new case: the reused network at both starting epsilons, then each source alone."""
    groups = [
        *((name,) for name in REUSED_NAMES),
        *(
            tuple(f"case {case}" for case in SOURCES[k : k + sources_a_panel])
            for k in range(0, len(SOURCES), sources_a_panel)
        ),
    ]
    panels = []
    for group in groups:
        arms = [
            Arm(REUSED_NAMES.get(name, name), REUSED[name], look_of(name))
            for name in group
            if study.arm(*REUSED[name])
        ]
        if arms:
            panels.append(Panel(arms, scratch_place(*arms[0].place[:2])))
    return panels


def lay_out(
    width: float,
    sections: Sequence[Section],
    columns: int,
    heights: Mapping[str, float],
    label: str,
    handles: Sequence[Artist] = (),
    names: int = 0,
) -> tuple[Figure, list[list[Drawn]]]:
    """Make a figure with a stack of axes for each panel.

    Args:
        width: in inches; a narrow figure has two columns.
        sections: the panels; each section begins a row under its heading.
        columns: maximum number of panels in a row of a wide figure.
        heights: of each panel's axes in inches, from top to bottom, by what is drawn in them.
        label: of the horizontal axes.
        handles: of a legend below all panels.
        names: lines of a panel's legend beside those of its arms.

    Returns:
        The figure, and the panels of each section.
    """
    columns = 2 if width == NARROW else min(columns, max(len(section.panels) for section in sections))
    counts = [-(-len(section.panels) // columns) for section in sections]
    lines = [max(len(panel.arms) for panel in section.panels) + names for section in sections]
    # Beside the axes: a heading, and in each row numbers and a legend.
    tall = [
        0.1 + 0.16 * len(section.heading.splitlines()) + count * (sum(heights.values()) + 0.3 + 0.15 * line)
        for section, count, line in zip(sections, counts, lines, strict=True)
    ]
    legend_columns = 2 if width == NARROW else max(1, len(handles))
    foot = 0.25 + 0.17 * -(-len(handles) // legend_columns)
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03)
    figure = Figure(figsize=(width, sum(tall) + foot), dpi=DPI[width], layout=layout)
    parts = figure.subfigures(len(sections), 1, squeeze=False, height_ratios=tall)[:, 0]
    drawn: list[list[Drawn]] = []
    for part, section, count in zip(parts, sections, counts, strict=True):
        part.suptitle(section.heading, x=0.005, ha="left", fontsize=FONT + 1, weight="bold")
        ratios = [*heights.values()] * count
        grid = part.subplots(count * len(heights), columns, squeeze=False, height_ratios=ratios, sharex=True)
        drawn.append([])
        for k in range(count * columns):
            row, column = divmod(k, columns)
            axes = grid[row * len(heights) : (row + 1) * len(heights), column]
            if k >= len(section.panels):
                for axis in axes:
                    axis.remove()
                continue
            for axis, name in zip(axes, heights, strict=True):
                style_axis(axis)
                axis.tick_params(labelleft=column == 0, labelbottom=axis is axes[-1])
                if column == 0:
                    axis.set_ylabel(name, fontsize=FONT, labelpad=2)
            drawn[-1].append(Drawn(section.panels[k], axes))
    # Of the last part, because a label of the figure would lie upon the legend.
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
