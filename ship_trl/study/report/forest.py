"""All contrasts of a figure's claims: estimate, interval, margin and verdict, a row for each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isfinite
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ship_trl.study.analysis.contrasts import Finding
from ship_trl.study.analysis.measured import SPREAD
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.report.figures import FONT, PALE, SMALL, VERDICTS, Form, plain

# In inches: a row, a line of words above it, a line of a claim's name, under it, numbers below, at the edges.
ROW, WORDS, LINE, UNDER, NUMBERS, EDGE = 0.17, 0.125, 0.16, 0.05, 0.36, 0.1
# On a page numbers stand at the right, and words at the left, in as much room as the longest needs.
RIGHT = 2.65
# Letters of an inch: of bold ones, and of a contrast's.
BOLD, LETTERS = 13.5, 16.5
# An interval is cut off, with an arrow, beyond so many times the largest estimate.
MOST = 2.5
# Words stand clear of the lines that they lie on.
CLEAR = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}
GREY = VERDICTS["inconclusive"][0]
RATIO, START, DIFFERENCE = "logarithm of the ratio", "score before training", "difference"


@dataclass(frozen=True)
class Block:
    """Contrasts of a claim that have one unit; `head` are the claim's lines, of its first block alone."""

    head: list[str]
    word: str
    unit: str
    findings: list[Finding]


def unit(finding: Finding) -> str:
    """Return what a contrast's numbers are: scores and shares of episodes lie on one axis, others do not."""
    return {SPREAD: RATIO, "start": START}.get(finding.metric, DIFFERENCE)


def blocks(answers: Sequence[Answer], letters: int) -> Iterator[Block]:
    """Yield a claim's contrasts by unit, in the claim's order; lines have at most so many letters."""
    for answer in answers:
        _, _, mark = VERDICTS.get(answer.word, ("", "", ""))
        head = wrap(
            f"{mark} {answer.hypothesis.name} {answer.word}: {answer.hypothesis.sentence}".strip(), letters
        )
        parts = [(name, list(found)) for name, found in groupby(answer.findings, unit)]
        for k, (name, found) in enumerate(parts or [("", [])]):
            yield Block(head if k == 0 else [], answer.word, name, found)


def limits(findings: Sequence[Finding]) -> tuple[float, float]:
    """Return between which values contrasts of one unit are drawn: with zero and all estimates."""
    most = MOST * max(
        [abs(f.estimate.value) for f in findings] + [f.margin or 0.0 for f in findings] + [0.01]
    )
    ends = [end for f in findings for end in (f.estimate.low, f.estimate.high)]
    inside = [min(max(end, -most), most) for end in ends]
    low, high = min([*inside, 0.0]), max([*inside, 0.0])
    room = 0.03 * (high - low) or most
    return low - room, high + room


def draw_forest(answers: Sequence[Answer], form: Form) -> Figure | None:
    """Draw the contrasts of one figure's claims, those of a unit on one scale; None without any."""
    found = [finding for answer in answers for finding in answer.findings]
    if not found:
        return None
    scales = {name: limits([f for f in found if unit(f) == name]) for name in map(unit, found)}
    shown = list(blocks(answers, int(BOLD * (form.width - 2 * EDGE))))
    # A telephone's rows have no room for a word: the marks are explained below.
    foot = 2 * LINE + EDGE if form.narrow else 0.0
    total = EDGE + sum(height_of(block, form) for block in shown) + foot
    figure = Figure(figsize=(form.width, total), dpi=form.dpi)
    longest = max(len(line) for finding in found for line in lines_of(finding, form))
    left, right = (EDGE, EDGE) if form.narrow else (2 * EDGE + longest / LETTERS, RIGHT)
    depth = EDGE
    for block in shown:
        for line in block.head:
            figure.text(
                EDGE / form.width,
                1 - depth / total,
                line,
                fontsize=FONT + 0.5,
                weight="bold",
                va="top",
                color=VERDICTS.get(block.word, (GREY,))[0],
            )
            depth += LINE
        if not block.findings:
            depth += EDGE
            continue
        depth += UNDER
        height = sum(row_height(finding, form) for finding in block.findings)
        box = (
            left / form.width,
            1 - (depth + height) / total,
            (form.width - left - right) / form.width,
            height / total,
        )
        axis = figure.add_axes(box)
        axis.set_xlim(scales[block.unit])
        draw_block(axis, block, form)
        depth += height + NUMBERS
    if foot:
        for k, (word, (colour, _, mark)) in enumerate(VERDICTS.items()):
            x, y = (EDGE + k % 2 * form.width / 2) / form.width, (foot - k // 2 * LINE) / total
            figure.text(x, y, f"{mark} {word}", fontsize=FONT, va="top", color=colour)
    return figure


def height_of(block: Block, form: Form) -> float:
    """Return a block's height in inches."""
    rows = sum(row_height(finding, form) for finding in block.findings)
    return LINE * len(block.head) + (UNDER + rows + NUMBERS if rows else EDGE)


def row_height(finding: Finding, form: Form) -> float:
    """Return a contrast's height in inches."""
    return ROW + (WORDS * len(lines_of(finding, form)) if form.narrow else 0.0)


def lines_of(finding: Finding, form: Form) -> list[str]:
    """Return a contrast's words, in lines; on a telephone its number stands beside the first."""
    words = finding.what.replace("; logarithm of the ratio", "")
    for kind in ("FE", "FT"):
        words = words.replace(", ".join(f"{kind}{n}" for n in range(1, 5)), f"{kind}1 to {kind}4")
    return wrap(words, int(LETTERS * (form.width - 2 * EDGE - 0.55))) if form.narrow else [words]


def draw_block(axis: Axes, block: Block, form: Form) -> None:
    """Draw a row for each contrast, from above; down the axes are inches."""
    plain(axis, left=False)
    axis.grid(visible=False, axis="y")
    axis.spines["left"].set_visible(False)
    axis.tick_params(left=False)
    axis.set_ylim(sum(row_height(finding, form) for finding in block.findings), 0)
    axis.xaxis.set_major_locator(MaxNLocator(4 if form.narrow else 6))
    axis.set_xlabel(block.unit, fontsize=SMALL, labelpad=1)
    axis.axvline(0, color="black", linewidth=0.8, zorder=1)
    across = axis.get_yaxis_transform()
    top = 0.0
    for finding in block.findings:
        lines = lines_of(finding, form)
        colour, _, mark = VERDICTS[finding.verdict.value]
        value = f"{finding.estimate.value:+.3f}"
        if form.narrow:
            for k, line in enumerate(lines):
                y = top + WORDS * (k + 0.6)
                axis.text(0, y, line, fontsize=SMALL, va="center", transform=across, bbox=CLEAR)
            # The number alone: there is no room for the ends of the interval, which is drawn.
            where, side, y = 1.0, "right", top + WORDS * 0.6
            value = f"{mark} {value}"
            top += WORDS * len(lines)
        else:
            where, side, y = 1.02, "left", top + ROW / 2
            value += f" ({ends(finding)}) {mark} {finding.verdict.value}"
            axis.text(-0.02, y, lines[0], fontsize=SMALL, ha="right", va="center", transform=across)
        style: dict[str, Any] = {"fontsize": SMALL, "ha": side, "va": "center", "color": colour}
        axis.text(where, y, value, transform=across, bbox=CLEAR, **style)
        draw_interval(axis, finding, top + ROW / 2)
        top += ROW


def draw_interval(axis: Axes, finding: Finding, y: float) -> None:
    """Draw margin, estimate and interval, with an arrow at an end that lies beyond the axes."""
    colour, marker, _ = VERDICTS[finding.verdict.value]
    if finding.margin is not None:
        ends_of_it, half = [-finding.margin, finding.margin], ROW / 2
        axis.fill_between(ends_of_it, y - half, y + half, color=PALE, linewidth=0, zorder=0.5)
    least, most = axis.get_xlim()
    low, high = max(finding.estimate.low, least), min(finding.estimate.high, most)
    axis.plot([low, high], [y, y], color=colour, linewidth=1.1, solid_capstyle="butt")
    for end, cut, arrow in (
        (low, finding.estimate.low < least, "<"),
        (high, finding.estimate.high > most, ">"),
    ):
        axis.plot(end, y, arrow if cut else "|", color=colour, markersize=4, clip_on=False)
    face = "white" if finding.verdict.value == "inconclusive" else colour
    axis.plot(finding.estimate.value, y, marker, color=colour, markersize=4.5, markerfacecolor=face)


def ends(finding: Finding) -> str:
    """Write an interval, or that nothing bounds it."""
    low, high = finding.estimate.low, finding.estimate.high
    return f"{low:+.3f} to {high:+.3f}" if isfinite(low) and isfinite(high) else "unbounded"
