"""Charts of the measurements: probes, CKA and erased things."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.measure import PIXELS
from ship_trl.explain.rows import Measured, Role
from ship_trl.view.chart import tidy

# Keyword arguments of Matplotlib.
Style = dict[str, Any]
# Inches, and pixels an inch: at 1,200 pixels 9 points are 12 pixels high.
WIDTH, DPI = 12.0, 150
# Okabe and Ito's colours are safe for colour blindness; markers and dashes differ for print in grey.
STYLES: dict[Role, Style] = {
    Role.explained: {"color": "#000000", "marker": "o", "linewidth": 2.2, "label": "explained network"},
    Role.before: {"color": "#D55E00", "marker": "^", "linestyle": "--", "label": "the same before training"},
    Role.source: {"color": "#0072B2", "marker": "s", "linestyle": "-.", "label": "source network"},
    Role.beside: {"color": "#009E73", "marker": "D", "linewidth": 1.0, "label": "other named networks"},
    Role.untrained: {"color": "#CC79A7", "marker": "x", "linestyle": ":", "label": "untrained (control)"},
}
PIXEL_STYLE: Style = {"color": "#E69F00", "linestyle": (0, (6, 2)), "label": "raw pixels (control)"}
SHUFFLED_STYLE: Style = {
    "color": "#666666",
    "marker": "+",
    "linestyle": "none",
    "label": "shuffled (control)",
}
# Lower R² is drawn here.
MIN_R2 = -0.15


def new_figure(height: float) -> Figure:
    """Begin a figure of the page's width; height in inches."""
    return Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")


def add_legend(figure: Figure, columns: int, styles: Sequence[Style] = ()) -> None:
    """Add a legend of line styles below the axes; without styles of all that is drawn."""
    entries: Style = {"handles": [Line2D([], [], **style) for style in styles]} if styles else {}
    figure.legend(**entries, loc="outside lower center", ncols=columns, fontsize=10, frameon=False)


def role_styles(measured: Measured) -> list[Style]:
    """Select the styles of the roles that are there."""
    return [STYLES[role] for role in Role if measured.with_role(role)]


def draw_probes(measured: Measured) -> Figure:
    """Draw R² of each quantity by layer, of every network and control."""
    quantities = list(dict.fromkeys(row.quantity for row in measured.probes))
    # Bearings above, distances below; without ships they stand side by side.
    bearings, distances = ([q for q in quantities if q.startswith(kind)] for kind in ("bearing", "distance"))
    columns = max(len(bearings), len(distances))
    rows = [bearings, distances] if columns > 1 else [bearings + distances]
    figure = new_figure(1.0 + 3.2 * len(rows))
    axes = figure.subplots(len(rows), max(2, columns), sharex=True, sharey=True, squeeze=False)
    for side, names in zip(axes, rows, strict=True):
        side[0].set_ylabel("R² on held-out episodes")
        for axis, name in zip(side, names, strict=False):
            draw_quantity(axis, measured, name)
        for axis in side[len(names) :]:
            axis.set_visible(False)
    add_legend(figure, 4, [*role_styles(measured), PIXEL_STYLE, SHUFFLED_STYLE])
    return figure


def draw_quantity(axis: Axes, measured: Measured, quantity: str) -> None:
    """Draw R² of one quantity."""
    rows = [row for row in measured.probes if row.quantity == quantity]
    x = range(len(measured.layers))
    (pixels,) = (row.r2 for row in rows if row.network == PIXELS)
    axis.axhline(pixels.value, **PIXEL_STYLE)
    axis.axhspan(pixels.low, pixels.high, color=PIXEL_STYLE["color"], alpha=0.15, linewidth=0)
    # The explained network last, on top.
    for one in reversed(measured.networks):
        # Rows are in the order of the layers.
        mine = [row for row in rows if row.network == one.name]
        axis.plot(x, [max(row.r2.value, MIN_R2) for row in mine], **STYLES[one.role])
        if one.role is Role.explained:
            axis.vlines(
                x, [max(row.r2.low, MIN_R2) for row in mine], [row.r2.high for row in mine], "#000000"
            )
            axis.plot(x, [max(row.shuffled_r2, MIN_R2) for row in mine], **SHUFFLED_STYLE)
    axis.set_title(quantity, fontsize=12)
    axis.set_xticks(x, measured.layers, fontsize=10)
    axis.tick_params(labelbottom=True)
    axis.set_ylim(MIN_R2 - 0.03, 1.03)
    tidy(axis, "y")


def draw_change(measured: Measured) -> Figure:
    """Draw CKA by layer: of the network before and after training, with its source, and between seeds."""
    figure = new_figure(5.2)
    axis = figure.subplots()
    x = np.arange(len(measured.layers))
    lines = (
        ("before and after training", Role.before, Role.explained, Role.explained),
        ("source, network before training", Role.source, Role.before, Role.before),
        ("source, network after training", Role.source, Role.explained, Role.source),
    )
    for k, (label, first, second, look) in enumerate(lines):
        pairs = [measured.cka_between(first, second, layer) for layer in measured.layers]
        if all(pairs):
            found: list[Estimate] = [rows[0].cka for rows in pairs]
            # Beside each other, so that intervals can be told apart.
            places = x + 0.05 * (k - 1)
            axis.plot(places, [one.value for one in found], **STYLES[look] | {"label": label})
            axis.vlines(
                places, [one.low for one in found], [one.high for one in found], STYLES[look]["color"]
            )
    groups = (
        ("different seeds, same settings: mean and range", measured.cka_between_seeds, Role.beside),
        (
            "network after training, untrained networks: mean and range",
            lambda layer: measured.cka_between(Role.explained, Role.untrained, layer),
            Role.untrained,
        ),
    )
    for label, select, look in groups:
        values = [[row.cka.value for row in select(layer)] for layer in measured.layers]
        if all(values):
            low, high, mean = ([float(f(each)) for each in values] for f in (np.min, np.max, np.mean))
            axis.fill_between(x, low, high, color=STYLES[look]["color"], alpha=0.18, linewidth=0)
            axis.plot(x, mean, **STYLES[look] | {"label": label})
    axis.set_xticks(x, measured.layers, fontsize=11)
    axis.set_ylabel("CKA: 1 similar, 0 unrelated", fontsize=11)
    tidy(axis, "y")
    add_legend(figure, 2)
    return figure


def draw_erased(measured: Measured) -> Figure:
    """Draw how often the action changes when a thing is erased."""
    names = list(dict.fromkeys(row.thing for row in measured.erased))
    figure = new_figure(1.3 + 1.05 * len(names))
    axis = figure.subplots()
    offsets = np.linspace(-0.3, 0.3, len(measured.networks))
    for one, offset in zip(measured.networks, offsets, strict=True):
        rows = [row for row in measured.erased if row.network == one.name]
        y = [names.index(row.thing) + offset for row in rows]
        style = STYLES[one.role] | {"linestyle": "none"}
        axis.hlines(y, [row.changed.low for row in rows], [row.changed.high for row in rows], style["color"])
        axis.plot([row.changed.value for row in rows], y, **style)
    axis.set_yticks(range(len(names)), names, fontsize=11)
    axis.set_ylim(len(names) - 0.55, -0.45)
    axis.set_xlabel("share of states in which the action changes", fontsize=11)
    axis.set_xlim(-0.03, 1.0)
    tidy(axis, "x")
    add_legend(figure, 3, role_styles(measured))
    return figure
