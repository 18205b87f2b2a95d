"""Figures 5 to 7 and 9 in the paper's form, with greedy returns below: PNG and PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ship_trl.curve import moving_mean
from ship_trl.paths import replacing
from ship_trl.study.analysis.study import Study
from ship_trl.study.plan.config import NEW_CASE, REUSED_ARM, REUSED_CASE
from ship_trl.study.plan.jobs import ALONE, FURTHER_SOURCES, LOW, LOW_EPSILON, ONE, OTHER_SOURCES, PAIRS
from ship_trl.study.records.record import Record

# Okabe and Ito's colours, which are told apart without colour vision; dashes do it in print.
STYLES = {
    "scratch": ("#000000", "-"),
    "1": ("#0072B2", "-"),
    "2": ("#D55E00", "--"),
    "3": ("#009E73", "-."),
    "4": ("#CC79A7", ":"),
    "W": ("#E69F00", (0, (5, 1, 1, 1, 1, 1))),
}
SIDES = {
    "feature extraction": ("scratch", "FE1", "FE2", "FE3", "FE4"),
    "finetuning": ("scratch", "FT1", "FT2", "FT3", "FT4", "FTW"),
}
NUMBERS = {"high": "5", "low": "6", "lowest": "7"}
# Training episodes in a moving mean, as a share of all.
SMOOTH = 0.05


def smoothed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the moving mean over `SMOOTH` of the values: [..., N] to [..., N]."""
    return moving_mean(values, max(1, round(SMOOTH * values.shape[-1])))


def pairs(study: Study) -> list[str]:
    """Pairs that were run: the paper's in its order, then others."""
    found = sorted({pair for part, pair, _, _ in study.records if part == PAIRS})
    return [*(pair for pair in NUMBERS if pair in found), *(pair for pair in found if pair not in NUMBERS)]


def draw_pair(study: Study, pair: str) -> Figure | None:
    """Figure 5, 6 or 7: training return above, greedy return below; mean over seeds, band: one deviation."""
    arms = {arm: list(study.arm(PAIRS, pair, arm).values()) for side in SIDES.values() for arm in side}
    if not any(arms.values()):
        return None
    figure = Figure(figsize=(11, 7), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (side, names) in enumerate(SIDES.items()):
        for name in names:
            if arms[name]:
                lines(axes[:, column], name, arms[name], style(name))
        axes[0, column].set_title(side)
        axes[1, column].set_xlabel("training episodes")
        if axes[0, column].lines:
            axes[0, column].legend(loc="lower right", fontsize=8, ncols=2)
    axes[0, 0].set_ylabel("training return")
    axes[1, 0].set_ylabel("greedy return")
    figure.suptitle(title(study, pair))
    return figure


def title(study: Study, pair: str) -> str:
    """Of a pair's figure: the paper's number, source and target."""
    name = f"Figure {NUMBERS[pair]}: pair {pair}" if pair in NUMBERS else f"Pair {pair}"
    source, target = study.cases(pair)
    return f"{name}, {f'case {source} to ' if source else ''}case {target}"


def draw_reuse(study: Study) -> Figure | None:
    """Figure 9: the reused network on the new case, from scratch beside it, and sources trained alike."""
    panels: Sequence[Mapping[str, tuple[str, str, str]]] = (
        {
            f"{name}, epsilon from {epsilon:g}": (part, label, arm)
            for part, epsilon in ((LOW, LOW_EPSILON), (ONE, 1))
            for name, label, arm in (
                ("reused (cases 1, 2)", f"{REUSED_CASE}-{NEW_CASE}", REUSED_ARM),
                ("scratch", NEW_CASE, "scratch"),
            )
        },
        {
            f"case {case}": (ALONE if case == REUSED_CASE else LOW, f"{case}-{NEW_CASE}", REUSED_ARM)
            for case in sorted((REUSED_CASE, *OTHER_SOURCES, *FURTHER_SOURCES))
        },
    )
    found = [{n: list(study.arm(*place).values()) for n, place in panel.items()} for panel in panels]
    if not any(runs for panel in found for runs in panel.values()):
        return None
    figure = Figure(figsize=(11, 7), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    looks = list(STYLES.values())
    sides = ("network and starting epsilon", f"sources, each alone, epsilon from {LOW_EPSILON:g}")
    for column, (side, panel) in enumerate(zip(sides, found, strict=True)):
        for k, (name, runs) in enumerate(panel.items()):
            if runs:
                lines(axes[:, column], name, runs, looks[k])
        axes[0, column].set_title(side)
        axes[1, column].set_xlabel("training episodes")
        if axes[0, column].lines:
            axes[0, column].legend(loc="lower right", fontsize=8)
    axes[0, 0].set_ylabel("training return")
    axes[1, 0].set_ylabel("greedy return")
    figure.suptitle("Figure 9: reuse on the new case")
    return figure


def style(arm: str) -> tuple[str, Any]:
    """Colour and dashes of an arm: by its layers."""
    return STYLES[arm if arm in STYLES else arm[2:3]]


def lines(axes: Sequence[Axes], name: str, runs: Sequence[Record], look: tuple[str, Any]) -> None:
    """Draw an arm's training return in the first axes and its greedy return in the second."""
    length = min(len(run.training.returns) for run in runs)
    count = min(len(run.greedy.returns) for run in runs)
    trained = smoothed(np.stack([run.training.returns[:length] for run in runs]))
    greedy = np.stack([run.greedy.returns[:count] for run in runs])
    label = f"{name} ({len(runs)})"
    for axis, x, values in (
        (axes[0], np.arange(1, length + 1), trained),
        (axes[1], runs[0].greedy.episode[:count], smoothed(greedy)),
    ):
        mean, spread = values.mean(axis=0), values.std(axis=0, ddof=1 if len(values) > 1 else 0)
        axis.plot(x, mean, color=look[0], linestyle=look[1], linewidth=1.5, label=label)
        axis.fill_between(x, mean - spread, mean + spread, color=look[0], alpha=0.12, linewidth=0)
        axis.grid(color="#8888", linewidth=0.4)
        axis.spines[["top", "right"]].set_visible(False)


def save(figure: Figure, path: Path) -> list[Path]:
    """Write PNG and PDF of a name without its ending; the same figure gives the same bytes."""
    written = []
    for ending, about in (("png", {"Software": None}), ("pdf", {"CreationDate": None})):
        target = path.with_suffix(f".{ending}")
        with replacing(target) as draft:
            figure.savefig(draft, format=ending, metadata=about)
        written.append(target)
    return written
