"""How the report's figures look, and how they are saved: forms, colours, lines, bands; PNG and PDF."""

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
from ship_trl.files.disk import replacing
from ship_trl.study.analysis.bands import LEAST, band
from ship_trl.study.analysis.contrasts import Verdict
from ship_trl.study.analysis.measured import SEED

# Training episodes in a moving mean, as a share of all.
SMOOTH = 0.05
# Places at which a curve is drawn: a small panel has no more pixels to show.
PLACES = 150
# In points. Both forms are shown at about the size that they are drawn at.
FONT, SMALL = 8.0, 7.5


@dataclass(frozen=True)
class Form:
    """What a figure is drawn for: its width in inches, and the pixels of an inch."""

    width: float
    dpi: int

    @property
    def narrow(self) -> bool:
        """Whether it is for a telephone."""
        return self.width < 6


# The page is 75 rem wide at most; a telephone of 380 pixels leaves 348 to a figure.
PAGE, TELEPHONE = Form(11.0, 110), Form(3.6, 180)


@dataclass(frozen=True)
class Look:
    """A line's colour and dashes."""

    colour: str
    dashes: Any = "-"


# Okabe and Ito's colours, which are told apart without colour vision; dashes do it in print. Black is
# scratch, everywhere.
SCRATCH = Look("#000000")
LOOKS = (
    Look("#0072B2"),
    Look("#D55E00", (0, (4, 1.5))),
    Look("#009E73", (0, (4, 1, 1, 1))),
    Look("#CC79A7", (0, (1, 1))),
)
GREY, PALE = "#6b7280", "#d9dce1"
# The words of the page have the same marks; colours are dark enough to be read as text.
VERDICTS = {
    Verdict.supported.value: ("#00704f", "^", "\N{BLACK UP-POINTING TRIANGLE}"),
    Verdict.contradicted.value: ("#b34700", "v", "\N{BLACK DOWN-POINTING TRIANGLE}"),
    Verdict.equivalent.value: ("#0072B2", "s", "="),
    Verdict.inconclusive.value: (GREY, "o", "?"),
}


def smoothed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the moving mean over `SMOOTH` of the values: [..., N] to [..., N]."""
    return moving_mean(values, max(1, round(SMOOTH * values.shape[-1])))


def places(count: int) -> NDArray[np.int64]:
    """Return `PLACES` of so many places, evenly, with the first and the last; all where they are fewer."""
    return np.unique(np.linspace(0, count - 1, min(count, PLACES)).round().astype(np.int64))


def draw_curves(axis: Axes, x: NDArray[Any], curves: NDArray[np.float64], look: Look) -> tuple[float, float]:
    """Draw seeds [S, T] as an interquartile mean and its band, or as thin lines where they are too few.

    Returns:
        The least and the largest value that was drawn.
    """
    if len(curves) < LEAST:
        for row in curves:
            axis.plot(x, row, color=look.colour, linestyle=look.dashes, linewidth=0.6)
        return float(curves.min()), float(curves.max())
    # Each line has a generator of its own: it is the same whatever else is drawn.
    found = band(curves, np.random.default_rng(SEED))
    axis.fill_between(x, found.low, found.high, color=look.colour, alpha=0.18, linewidth=0)
    axis.plot(x, found.middle, color=look.colour, linestyle=look.dashes, linewidth=1.3)
    return float(found.low.min()), float(found.high.max())


def along(axis: Axes, end: float) -> None:
    """Let axes go from 0 to an end, whose numbers stay clear of those of the next panel."""
    axis.set_xlim(0, end)
    axis.set_xticks([0, end / 2, end], [f"{value:g}" for value in (0, end / 2, end)])
    # Of hidden numbers there are none here.
    sides: tuple[Literal["left", "center", "right"], ...] = ("left", "center", "right")
    for label, side in zip(axis.get_xticklabels(), sides, strict=False):
        label.set_horizontalalignment(side)


def plain(axis: Axes, *, left: bool = True, below: bool = True) -> None:
    """Give axes a light grid and small numbers, on the left and below where they are asked for."""
    axis.grid(color="#8888", linewidth=0.4)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=SMALL, length=2, pad=2, labelleft=left, labelbottom=below)


def legend_above(axis: Axes, looks: Sequence[tuple[str, Look]]) -> None:
    """Name a panel's lines above it, a line each."""
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
    """Write PNG and PDF of a name without its ending; the same figure gives the same bytes."""
    document = io.BytesIO()
    # On a full disk matplotlib's PDF writer fails once more as it ends, and hides why.
    figure.savefig(document, format="pdf", metadata={"CreationDate": None})
    written = {path.with_suffix(".png"): as_png(figure), path.with_suffix(".pdf"): document.getvalue()}
    for file, data in written.items():
        with replacing(file) as draft:
            draft.write_bytes(data)
    return list(written)


def as_png(figure: Figure) -> bytes:
    """Return a figure's PNG; 256 colours are a third of the bytes, and the page holds two forms of each."""
    drawn, data = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png")
    # An octree keeps the colours of thin lines; what counts pixels would mix them with their neighbours.
    few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(data, "png")
    return data.getvalue()
