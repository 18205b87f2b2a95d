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
from ship_trl.study.plan import LOW_EPSILON, SOURCE_CASES, WHOLE
from ship_trl.study.statistics import MIN_BAND_SEEDS, band
from ship_trl.view import style as view
from ship_trl.view.style import BROWN, CHART, CHART_SERIES, DASHED, Style, line

# Inches, close to the size on the page, which is at most 75 rem wide; and of a figure that fits a phone.
WIDTH, NARROW = 11.0, 4.4
# Pixels an inch of a narrow figure, which a wide page enlarges.
NARROW_DPI = 220
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
PALE = "#d9dce1"
EPSILON = "\N{GREEK SMALL LETTER EPSILON}"
# Names of the reused network in figures.
REUSED_NAMES = {"reused, low": f"reused, {EPSILON} {LOW_EPSILON:g}", "reused, 1": f"reused, {EPSILON} 1"}


# Looks of the networks on the new case: of the reused one, and by source.
LOOKS = {
    **dict.fromkeys(REUSED_NAMES.values(), view.look_of(WHOLE)),
    **{
        f"case {case}": line(colour, DASHED if k % 2 else "-")
        for k, (case, colour) in enumerate(
            zip(SOURCE_CASES, (*CHART_SERIES[:4], CHART_SERIES[5], BROWN), strict=True)
        )
    },
}


def look_of(name: str) -> Style:
    """Return the look of an arm, or of a network on the new case."""
    return LOOKS.get(name) or view.look_of(name)


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
