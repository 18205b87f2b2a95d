"""The style of the report's figures: sizes, the look of each arm, and how figures are saved."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import atomic_write
from ship_trl.study.compare import SEED
from ship_trl.study.plan import FE, FT, PERMUTED, RANDOM, SCRATCH, TRANSFERS, WHOLE, control_arm
from ship_trl.study.statistics import MIN_BAND_SEEDS, band
from ship_trl.view.palette import CHART_SERIES

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
