"""A transfer beside learning from scratch: one panel, to be read at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import replacing
from ship_trl.view.curve import KNOWN, MEAN, MEAN_OVER
from ship_trl.view.lettering import number

# Okabe and Ito's orange; the dashes tell it apart without colour.
SCRATCH = "#E69F00"


def draw_transfer(
    path: Path,
    arm: str,
    returns: Sequence[float],
    scratch: NDArray[np.float64],
    best_return: float,
    title: str,
) -> None:
    """Write training returns of a transfer and of runs from scratch as a PNG of 1200 x 750.

    Args:
        path: where it goes; written beside and renamed.
        arm: what the transfer is called.
        returns: of its training episodes, raw [E].
        scratch: those of S runs from scratch [S, E].
        best_return: the best return known for the case, raw; a line across.
        title: one line above.

    Raises:
        OSError: the file cannot be written.
    """
    figure = Figure(figsize=(12, 7.5), dpi=100, layout="constrained")
    axes = figure.subplots()
    # The title holds names of files; a dollar sign in one is no formula.
    axes.set_title(f"{title}, beside learning from scratch", fontsize=15, loc="left", parse_math=False)
    others = moving_mean(scratch, MEAN_OVER)
    episodes = np.arange(1, others.shape[1] + 1)
    seeds = "1 seed"
    if len(others) > 1:
        seeds = f"{len(others)} seeds, the middle one"
        label = "from scratch: from the worst to the best seed"
        axes.fill_between(episodes, others.min(0), others.max(0), color=SCRATCH, alpha=0.2, lw=0, label=label)
    label = f"from scratch: {seeds}; mean of all episodes {number(scratch.mean(), '.0f')}"
    axes.plot(episodes, np.median(others, 0), color=SCRATCH, linestyle="--", linewidth=2.2, label=label)
    mean, whole = moving_mean(returns, MEAN_OVER), sum(returns) / len(returns)
    label = f"{arm}, this run; mean of all episodes {number(whole, '.0f')}"
    axes.plot(np.arange(1, len(mean) + 1), mean, color=MEAN, linewidth=2.8, label=label)
    label = f"best known return: {best_return:.1f}"
    axes.axhline(best_return, color=KNOWN, linestyle=":", linewidth=2.2, label=label)
    axes.set_xlabel("training episodes", fontsize=12)
    axes.set_ylabel(f"training return, mean of the last {MEAN_OVER} episodes", fontsize=12)
    axes.grid(color="#E4E4E4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=12)
    with replacing(path) as draft:
        figure.savefig(draft)
