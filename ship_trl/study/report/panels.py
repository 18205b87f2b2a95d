"""Figures of many small panels: which arms share a panel, and how panels are laid out at a width."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ship_trl.study.plan import (
    CONTROL_ARMS,
    CONTROL_KINDS,
    FE,
    FT,
    LOW_EPSILON,
    NEW_CASE,
    PAIRS,
    SOURCE_CASES,
    WHOLE,
    Place,
    control_arm,
    rivals,
    scratch_place,
)
from ship_trl.study.report.style import DPI, FONT, NARROW, Look, look_of, style_axis
from ship_trl.study.study import Study, pairs, places_of

EPSILON = "\N{GREEK SMALL LETTER EPSILON}"
# Names of the reused network in panels.
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
        arms = [Arm(REUSED_NAMES.get(arm, arm), places[arm], look_of(arm)) for arm in group if arm in places]
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
