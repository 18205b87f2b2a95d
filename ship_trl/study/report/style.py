"""How the report's figures look: Matplotlib's settings, the look of each arm, curves, and saving."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import RcKeyType
from numpy.typing import NDArray
from PIL import Image

from ship_trl.files.curve import moving_mean
from ship_trl.files.disk import atomic_write
from ship_trl.study.compare import SEED
from ship_trl.study.plan import (
    CONTROL_KINDS,
    FE,
    FT,
    LOW_EPSILON,
    SCRATCH,
    SOURCE_CASES,
    TRANSFERS,
    WHOLE,
    control_arm,
)
from ship_trl.study.statistics import MIN_BAND_SEEDS, band
from ship_trl.view.style import CHART, CHART_SERIES, Style

# Inches, close to the size on the page, which is at most 75 rem wide.
WIDTH = 11.0
# Font sizes in points.
FONT, SMALL = 8.0, 7.5
# Matplotlib's settings, while figures are drawn and saved.
REPORT: dict[RcKeyType, Any] = {
    **CHART,
    "figure.dpi": 110,
    "figure.titlesize": FONT + 1,
    "figure.titleweight": "bold",
    "figure.labelsize": FONT,
    "font.size": FONT,
    "axes.titlesize": FONT,
    "axes.titlelocation": "left",
    "axes.labelsize": FONT,
    "axes.labelpad": 2,
    "grid.color": "#8888",
    "grid.linewidth": 0.4,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.size": 2,
    "ytick.major.size": 2,
    "xtick.major.pad": 2,
    "ytick.major.pad": 2,
    "legend.fontsize": FONT,
}
# A curve is a moving mean over this share of its values, drawn at this many points.
SMOOTH, POINTS = 0.05, 150
GREY, PALE = "#6b7280", "#d9dce1"
# Colours that colour-blind people can tell apart; in black and white the dashes differ.
BLUE, VERMILION, GREEN, PINK, ORANGE, SKY = CHART_SERIES
BROWN = "#7f5539"
DASHED, DOTTED, DASH_DOTTED = (0, (4, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1))
EPSILON = "\N{GREEK SMALL LETTER EPSILON}"
# Names of the reused network in figures.
REUSED_NAMES = {"reused, low": f"reused, {EPSILON} {LOW_EPSILON:g}", "reused, 1": f"reused, {EPSILON} 1"}


def line(colour: str, dashes: Any = "-") -> Style:
    """Return the look of a line."""
    return {"color": colour, "linestyle": dashes}


# The look of every arm. All controls of a kind look alike; networks on the new case are named by source.
LOOKS = {
    SCRATCH: line("#000000"),
    **{arm: line(colour) for arm, colour in zip(FE, (BLUE, VERMILION, GREEN, PINK), strict=True)},
    **{arm: line(colour, DASHED) for arm, colour in zip(FT, (BLUE, VERMILION, GREEN, PINK), strict=True)},
    **{
        control_arm(arm, kind): look
        for kind, look in zip(CONTROL_KINDS, (line(SKY, DOTTED), line(BROWN, DASH_DOTTED)), strict=True)
        for arm in TRANSFERS
    },
    **dict.fromkeys((WHOLE, *REUSED_NAMES.values()), line(ORANGE, DASH_DOTTED)),
    **{
        f"case {case}": line(colour, DASHED if k % 2 else "-")
        for k, (case, colour) in enumerate(
            zip(SOURCE_CASES, (BLUE, VERMILION, GREEN, PINK, SKY, BROWN), strict=True)
        )
    },
}
# Other methods of transfer by the letters that their arms begin with.
OTHER_LOOKS = {"FE": SKY, "FT": BROWN, "GU": BLUE, "SP": VERMILION, "G": GREEN, "QD": PINK, "QR": ORANGE}


def look_of(arm: str) -> Style:
    """Return the look of an arm; unknown ones are grey."""
    colours = (colour for prefix, colour in OTHER_LOOKS.items() if arm.startswith(prefix))
    return LOOKS.get(arm) or line(next(colours, GREY), DOTTED)


def points(count: int) -> NDArray[np.int64]:
    """Return up to `POINTS` evenly spaced indices, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, POINTS)).round().astype(np.int64))


def smooth(curves: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return `points` [T] up to the end of the shortest of S curves, and the moving means there [S, T]."""
    length = min(map(len, curves))
    shown = points(length)
    means = moving_mean(np.stack([curve[:length] for curve in curves]), max(1, round(SMOOTH * length)))
    return shown, means[:, shown]


def draw_curves(
    axis: Axes, x: NDArray[Any], curves: NDArray[np.float64], look: Mapping[str, Any], name: str = ""
) -> tuple[float, float]:
    """Draw seeds [S, T] as interquartile mean and band, few seeds as thin lines; return their range.

    The legend has the name, if there is one.
    """
    if len(curves) < MIN_BAND_SEEDS:
        for k, row in enumerate(curves):
            axis.plot(x, row, **look, linewidth=0.6, label=name if name and not k else None)
        return float(curves.min()), float(curves.max())
    # Each line has its own generator, so it does not depend on what else is drawn.
    middle, low, high = band(curves, np.random.default_rng(SEED))
    axis.fill_between(x, low, high, color=look["color"], alpha=0.18, linewidth=0)
    axis.plot(x, middle, **look, linewidth=1.3, label=name or None)
    return float(low.min()), float(high.max())


def legend_above(axis: Axes) -> None:
    """Draw a panel's legend above it, with one line in each row."""
    if axis.get_legend_handles_labels()[0]:
        form: Style = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.1, "borderpad": 0}
        axis.legend(**form, labelspacing=0.15, handlelength=2.0, handletextpad=0.5)


def save(figure: Figure, path: Path) -> bytes:
    """Write PNG and PDF to a path without suffix, and return the PNG; the same figure gives the same bytes.

    The PNG has 256 colours, which is a third of the bytes.
    """
    drawn, document, png = io.BytesIO(), io.BytesIO(), io.BytesIO()
    # Into memory: on a full disk Matplotlib's PDF writer raises a second error that hides the first.
    figure.savefig(document, format="pdf", metadata={"CreationDate": None})
    figure.savefig(drawn, format="png")
    # An octree keeps the colours of thin lines; other methods mix them with their neighbours.
    few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(png, "png")
    for suffix, data in ((".png", png), (".pdf", document)):
        with atomic_write(path.with_suffix(suffix)) as draft:
            draft.write_bytes(data.getvalue())
    return png.getvalue()
