"""Figures along the training: learning curves, differences from scratch, times to the threshold."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ship_trl.files.record import RunRecord
from ship_trl.study.metrics import THRESHOLDS, has_reached, measure
from ship_trl.study.plan import (
    CONTROL_ARMS,
    CONTROL_KINDS,
    FE,
    FT,
    NEW_CASE,
    PAIRS,
    SCRATCH,
    SOURCE_CASES,
    WHOLE,
    Place,
    control_arm,
    rivals,
    scratch_place,
)
from ship_trl.study.report.style import (
    NARROW,
    NARROW_DPI,
    PALE,
    REUSED_NAMES,
    WIDTH,
    draw_curves,
    legend_above,
    look_of,
    points,
    smooth,
)
from ship_trl.study.study import Study, pairs, places_of
from ship_trl.view.style import GREY, Style

# The share of a panel's height below the training returns, where the exploration rate is drawn.
STRIP = 0.14
WARMUP_ALPHA = 0.55
BEST_DASHES, RANDOM_DASHES = (0, (5, 2)), (0, (1, 2))
# Panels in a row of single arms, and of groups of arms, with inches of their height.
PAIR_COLUMNS, COLUMNS, HEIGHT = 5, 6, 1.2
# A pair with at most so many arms has one panel, which fits a phone.
FEW_ARMS = 3
# The places of some arms by name, and first of scratch, which they are compared with.
Panel = dict[str, Place]
# Panels by the heading above them.
Sections = Mapping[str, Sequence[Panel]]


def cases_of(study: Study, pair: str) -> str:
    """Name source and target of a pair."""
    source, target = study.cases(pair)
    return f"{f'case {source} to ' if source else ''}case {target}"


def pair_title(study: Study, pair: str) -> str:
    """Return the title of a pair's figure, with source and target."""
    return study.claims.title(pair, f"pair {pair}, {cases_of(study, pair)}")


def reuse_title(study: Study) -> str:
    """Return the title of the figure of the new case."""
    return study.claims.title(NEW_CASE, "reuse on the new case")


def make_panels(study: Study, name: str, groups: Iterable[Sequence[str]]) -> list[Panel]:
    """Return a panel for each group of arms of a pair, or of the new case, that has runs."""
    places, panels = places_of(study).get(name, {}), []
    for group in groups:
        if arms := {REUSED_NAMES.get(arm, arm): places[arm] for arm in group if arm in places}:
            part, label, _ = next(iter(arms.values()))
            panels.append({SCRATCH: scratch_place(part, label), **arms})
    return panels


def pair_sections(study: Study, pair: str) -> Sections:
    """Return a panel for each arm with its controls, feature extraction first; one panel for few arms."""
    title, scratch = pair_title(study, pair), scratch_place(PAIRS, pair)
    if few := few_arms(study, pair):
        return {title: make_panels(study, pair, [few])}
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
        return {title: [{SCRATCH: scratch}]}
    return sections


def few_arms(study: Study, pair: str) -> list[str]:
    """Return the arms of a pair beside scratch, if they are few."""
    arms = [arm for arm in places_of(study).get(pair, {}) if arm != SCRATCH]
    return arms if len(arms) <= FEW_ARMS else []


def grouped_sections(study: Study) -> Sections:
    """Return panels of two arms each, or of few: a section for each pair, and one for the new case."""
    groups = (FE[:2], FE[2:], FT[:2], FT[2:], (WHOLE,), CONTROL_ARMS)
    sections = {}
    for pair in pairs(study):
        others = [(arm,) for arm in rivals(places_of(study).get(pair, {}))]
        few = few_arms(study, pair)
        sections[pair_title(study, pair)] = make_panels(study, pair, [few] if few else (*groups, *others))
    return {heading: found for heading, found in (sections | reuse_sections(study, 2)).items() if found}


def reuse_sections(study: Study, sources_per_panel: int = 1) -> dict[str, list[Panel]]:
    """Return panels of the new case: the reused network at both starting epsilons, then single sources."""
    names, step = [f"case {case}" for case in SOURCE_CASES], sources_per_panel
    groups = [
        *([name] for name in REUSED_NAMES),
        *(names[k : k + step] for k in range(0, len(names), step)),
    ]
    panels = make_panels(study, NEW_CASE, groups)
    return {reuse_title(study): panels} if panels else {}


def lay_out(
    sections: Sections,
    columns: int,
    heights: Mapping[str, float],
    label: str,
    handles: Sequence[Artist] = (),
) -> tuple[Figure, list[list[tuple[Panel, Sequence[Axes]]]]]:
    """Make a figure with a stack of axes for each panel.

    Args:
        sections: each begins a new row under its heading.
        columns: maximum number of panels in a row.
        heights: of each panel's axes in inches, from top to bottom, by the label of their vertical axis.
        label: of the horizontal axes.
        handles: of a legend below all panels.

    Returns:
        The figure, and for each section its panels with their axes from top to bottom.
    """
    columns = min(columns, max(map(len, sections.values())))
    is_narrow, in_a_row = columns == 1, 2 if columns == 1 else len(handles)
    counts = [-(-len(panels) // columns) for panels in sections.values()]
    # A section has a heading, and each row has axes, tick labels and a legend.
    tall = []
    for (heading, panels), count in zip(sections.items(), counts, strict=True):
        row = sum(heights.values()) + 0.3 + 0.15 * max(map(len, panels))
        tall.append(0.1 + 0.16 * len(heading.splitlines()) + count * row)
    below = 0.25 + 0.17 * -(-len(handles) // max(1, in_a_row))
    size = NARROW if is_narrow else WIDTH, sum(tall) + below
    figure = Figure(size, dpi=NARROW_DPI if is_narrow else None)
    parts = figure.subfigures(len(sections), 1, squeeze=False, height_ratios=tall)[:, 0]
    drawn = []
    for part, (heading, panels), count in zip(parts, sections.items(), counts, strict=True):
        part.suptitle(heading, x=0.005, ha="left")
        ratios = [*heights.values()] * count
        grid = part.subplots(count * len(heights), columns, squeeze=False, height_ratios=ratios, sharex=True)
        stacks = grid.reshape(count, len(heights), columns).swapaxes(1, 2).reshape(-1, len(heights))
        for axis in stacks[len(panels) :].flat:
            axis.remove()
        for k, axes in enumerate(stacks[: len(panels)]):
            for axis, name in zip(axes, heights, strict=True):
                axis.tick_params(labelleft=k % columns == 0, labelbottom=axis is axes[-1])
                if k % columns == 0:
                    axis.set_ylabel(name)
        drawn.append(list(zip(panels, stacks, strict=False)))
    # On the last part, because a label of the whole figure would cover the legend.
    parts[-1].supxlabel(label)
    if handles:
        form: Style = {"loc": "outside lower center", "ncols": in_a_row, "columnspacing": 1.2}
        figure.legend(handles=list(handles), **form)
    return figure, drawn


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


def draw_returns(study: Study, sections: Sections) -> Figure | None:
    """Draw each panel's training returns above its greedy returns; all panels share their ranges.

    Sections of a pair make figure 5, 6 or 7, those of the new case figure 9; None without sections.
    """
    if not sections:
        return None
    panels = [panel for section in sections.values() for panel in section]
    counts = sorted({len(study.arm(*panel[SCRATCH])) for panel in panels})
    scratch = f"scratch ({' or '.join(map(str, counts))})"
    handles: list[Artist] = [
        Line2D([], [], **look_of(SCRATCH), linewidth=1.5, label=scratch),
        Line2D([], [], color=GREY, linestyle=BEST_DASHES, linewidth=1, label="best known return"),
        Line2D([], [], color=GREY, linestyle=RANDOM_DASHES, linewidth=1.2, label="random actions"),
    ]
    runs = [run for panel in panels for run in study.arm(*panel[SCRATCH]).values()]
    if any(np.isfinite(run.training.epsilon).any() for run in runs):
        handles += [
            Patch(color=PALE, label="exploration rate"),
            Line2D([], [], color=GREY, marker="|", markersize=9, linewidth=0, label="exploration ends"),
        ]
    if study.plan.warmup:
        handles.append(Patch(color=PALE, alpha=WARMUP_ALPHA, label="warm-up, no update yet"))
    heights = {"training return": 1.2, "greedy return": 0.8}
    figure, drawn = lay_out(sections, PAIR_COLUMNS, heights, "training episodes", handles)
    shown = [one for section in drawn for one in section]
    ranges = [draw_panel(study, panel, axes) for panel, axes in shown]
    for row, below in enumerate((STRIP, 0.0)):
        set_range([axes[row] for _, axes in shown], [each[row] for each in ranges], below)
    return figure


def draw_panel(study: Study, panel: Panel, axes: Sequence[Axes]) -> list[tuple[float, float]]:
    """Draw a panel's runs; return the ranges of its training returns and its greedy returns."""
    found = {name: runs for name, place in panel.items() if (runs := list(study.arm(*place).values()))}
    # The levels are the same for all arms; the exploration rate is the arm's, or else that of scratch.
    run = [*found.values()][min(1, len(found) - 1)][0]
    ranges = []
    for axis, kind in zip(axes, (attrgetter("training"), attrgetter("greedy")), strict=True):
        values = []
        for name, runs in found.items():
            shown, returns = smooth([kind(run).returns for run in runs])
            label = "" if name == SCRATCH else f"{name} ({len(runs)})"
            values.append(draw_curves(axis, kind(runs[0]).episode[shown], returns, look_of(name), label))
        for level, dashes in ((run.best_known, BEST_DASHES), (run.random_return, RANDOM_DASHES)):
            if np.isnan(level):
                continue
            axis.axhline(level, color=GREY, linestyle=dashes, linewidth=0.9, zorder=1)
            values.append((level, level))
        set_episodes(axis, len(run.training.returns))
        if study.plan.warmup:
            axis.axvspan(0, study.plan.warmup, color=PALE, alpha=WARMUP_ALPHA, linewidth=0, zorder=0.4)
        ranges.append((min(low for low, _ in values), max(high for _, high in values)))
    draw_exploration(axes, run)
    legend_above(axes[0])
    return ranges


def draw_exploration(axes: Sequence[Axes], run: RunRecord) -> None:
    """Draw the exploration rate along the bottom of the first axes, and its end in all of them."""
    rate = run.training.epsilon
    if np.isnan(rate).all():
        return
    shown = points(len(rate))
    bottom = axes[0].get_xaxis_transform()
    height = STRIP * rate[shown]
    axes[0].fill_between(shown + 1, 0, height, transform=bottom, color=PALE, linewidth=0, zorder=0.5)
    # The outline makes a low rate visible.
    axes[0].plot(shown + 1, height, transform=bottom, color=GREY, linewidth=0.6, zorder=0.6, clip_on=False)
    ended = np.flatnonzero(rate <= rate.min())[0]
    if 0 < ended < len(rate) - 1:
        for axis in axes:
            axis.axvline(ended + 1, color=GREY, linewidth=0.7, zorder=0.6)


def differences(study: Study, place: Place, scratch: Place) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes [T] and, by seed, moving training scores minus those of scratch [S, T]."""
    runs = study.matched({"arm": place, "scratch": scratch})
    count = len(runs["arm"])
    if not count:
        return np.empty(0), np.empty((0, 0))
    shown, scores = smooth([run.scores for run in runs["arm"] + runs["scratch"]])
    return shown + 1, scores[:count] - scores[count:]


def draw_differences(study: Study) -> Figure | None:
    """Draw each arm's differences from scratch; None where there is nothing to compare with."""
    sections = grouped_sections(study)
    panels = [panel for section in sections.values() for panel in section]
    found = {
        place: differences(study, place, panel[SCRATCH])
        for panel in panels
        for name, place in panel.items()
        if name != SCRATCH
    }
    if not any(len(curves) for _, curves in found.values()):
        return None
    figure, drawn = lay_out(sections, COLUMNS, {"score above scratch": HEIGHT}, "training episodes")
    for section in drawn:
        # The range of a section holds zero.
        ranges = [(0.0, 0.0)]
        for panel, (axis,) in section:
            axis.axhline(0, **look_of(SCRATCH), linewidth=1.0, zorder=1.5)
            for name, place in panel.items():
                if place in found and len(found[place][1]):
                    x, curves = found[place]
                    ranges.append(draw_curves(axis, x, curves, look_of(name), f"{name} ({len(curves)})"))
                    set_episodes(axis, x[-1])
            legend_above(axis)
        set_range([axis for _, (axis,) in section], ranges)
    return figure


def steps(runs: Sequence[RunRecord]) -> tuple[np.ndarray, np.ndarray]:
    """Return times from 0 to 1, and the share of the runs that have reached the threshold by then.

    A run that never reaches it counts among all runs, so the last share is below 1.
    """
    times = sorted(measure(run, "time") for run in runs if has_reached(run))
    shares = np.arange(len(times) + 1) / len(runs)
    return np.array([0.0, *times, 1.0]), np.append(shares, shares[-1])


def draw_times(study: Study) -> Figure | None:
    """Draw how many runs of each arm have reached the threshold over time; None if no run ever does."""
    sections = grouped_sections(study)
    if not sections or not any(map(has_reached, study.records.values())):
        return None
    label = f"share of the episodes until the moving score is at {THRESHOLDS[0]:g}"
    figure, drawn = lay_out(sections, COLUMNS, {"share of the runs": HEIGHT}, label)
    for panel, (axis,) in (one for section in drawn for one in section):
        for name, place in panel.items():
            if runs := list(study.arm(*place).values()):
                look = look_of(name) | {"label": f"{name} {sum(map(has_reached, runs))}/{len(runs)}"}
                axis.step(*steps(runs), where="post", clip_on=False, linewidth=1.3, **look)
        legend_above(axis)
        set_episodes(axis, 1)
        # A step at 1 stays clear of the names above it.
        axis.set_ylim(0, 1.06)
        axis.set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    return figure
