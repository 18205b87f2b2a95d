"""The learning curve of one run as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import replacing

MEAN_OVER = 25
# Colours of Okabe and Ito, told apart by any eye; the markers tell them apart without colour.
OUTCOMES = {"goal": ("#009E73", "o"), "collision": ("#D55E00", "x"), "timeout": ("#7A7A7A", "^")}
MEAN, GREEDY, KNOWN, EPSILON = "#0072B2", "#000000", "#CC79A7", "#E69F00"


class Trained(Protocol):
    """A training episode: its number, raw return, how it ended, exploration rate."""

    @property
    def episode(self) -> int: ...  # noqa: D102
    @property
    def episode_return(self) -> float: ...  # noqa: D102
    @property
    def outcome(self) -> str: ...  # noqa: D102
    @property
    def epsilon(self) -> float: ...  # noqa: D102


def draw_curve(
    path: Path,
    finished: Sequence[Trained],
    evaluated: Sequence[tuple[int, float, str]],
    best_return: float,
    title: str,
) -> None:
    """Write the learning curve as a PNG of 1200 x 800.

    Args:
        path: where it goes; written beside and renamed.
        finished: training episodes in order; outcome is goal, collision or timeout.
        evaluated: greedy evaluations in order: after how many episodes, raw return, outcome.
        best_return: the best return known for the case, raw.
        title: one line above.

    Raises:
        OSError: the file cannot be written.
    """
    figure = Figure(figsize=(12, 8), dpi=100, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    # The title holds names of files; a dollar sign in one is no formula.
    figure.suptitle(title, fontsize=15, fontweight="bold", parse_math=False)
    _draw_returns(upper, finished, evaluated, best_return)
    _draw_shares(lower, finished)
    for axes in (upper, lower):
        axes.grid(color="#E4E4E4", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.margins(x=0.01)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=10.5)
    with replacing(path) as draft:
        figure.savefig(draft)


def _draw_returns(
    axes: Axes,
    finished: Sequence[Trained],
    evaluated: Sequence[tuple[int, float, str]],
    best_return: float,
) -> None:
    for outcome, (colour, marker) in OUTCOMES.items():
        rows = [row for row in finished if row.outcome == outcome]
        # A legend entry stands for its outcome even where it never happened.
        axes.plot(
            [row.episode for row in rows],
            [row.episode_return for row in rows],
            linestyle="",
            marker=marker,
            markersize=4,
            color=colour,
            alpha=0.4,
            label=f"training: {outcome} ({len(rows)})",
        )
    mean = moving_mean([row.episode_return for row in finished], MEAN_OVER)
    axes.plot(
        [row.episode for row in finished],
        mean,
        color=MEAN,
        linewidth=2.2,
        label=f"training: mean of {MEAN_OVER}",
    )
    axes.step(
        [row[0] for row in evaluated],
        [row[1] for row in evaluated],
        where="post",
        color=GREEDY,
        linewidth=1.2,
        label="greedy evaluation",
    )
    for outcome, (colour, marker) in OUTCOMES.items():
        found = [row for row in evaluated if row[2] == outcome]
        if found:
            axes.plot(
                [row[0] for row in found],
                [row[1] for row in found],
                linestyle="",
                marker=marker,
                markersize=7,
                color=colour,
                # A cross has no face, and a black edge would be all of it.
                markeredgecolor=colour if marker == "x" else GREEDY,
                label=f"greedy: {outcome} ({len(found)})",
            )
    axes.axhline(
        best_return, color=KNOWN, linestyle="--", linewidth=1.8, label=f"best known: {best_return:.1f}"
    )
    axes.set_ylabel("return of an episode (undiscounted raw reward)")


def _draw_shares(axes: Axes, finished: Sequence[Trained]) -> None:
    episodes = [row.episode for row in finished]
    for outcome, style in (("goal", "-"), ("collision", "-.")):
        share = moving_mean([row.outcome == outcome for row in finished], MEAN_OVER)
        axes.plot(
            episodes,
            share,
            color=OUTCOMES[outcome][0],
            linestyle=style,
            linewidth=1.5,
            label=f"share of {outcome}s, last {MEAN_OVER}",
        )
    epsilons = [row.epsilon for row in finished]
    axes.plot(episodes, epsilons, color=EPSILON, linestyle=":", linewidth=2, label="exploration rate ε")
    axes.set_ylim(-0.04, 1.04)
    axes.set_ylabel("share (0 to 1)")
    axes.set_xlabel("training episodes")
