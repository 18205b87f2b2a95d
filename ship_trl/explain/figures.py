"""Figures of the page: charts of probes, CKA and erased things, and saliency maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from torch import Tensor

from ship_trl.explain.bootstrap import Floats
from ship_trl.explain.measure import OTHER_SEEDS, PAIRS, PIXELS, Measured
from ship_trl.explain.networks import Role
from ship_trl.explain.saliency import gradient, greedy_actions, occlusion
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.env import ShipEnv
from ship_trl.view.style import add_legend, tidy

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
SHUFFLED_STYLE: Style = {"color": "#666666", "marker": "+", "linestyle": "", "label": "shuffled (control)"}
# Blue below zero, orange above, from Okabe and Ito; in grey they differ from zero in brightness.
SIGNED = LinearSegmentedColormap.from_list("signed", ["#0072B2", "#F2F2F2", "#D55E00"])
# Lower R² is drawn here.
MIN_R2 = -0.15


def new_figure(height: float) -> Figure:
    """Begin a figure of the page's width; height in inches."""
    return Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")


def draw_probes(measured: Measured) -> Figure:
    """Draw R² by layer of every network and control: bearings above, distances below."""
    quantities = list(measured.probes.quantity.unique())
    kinds = [[name for name in quantities if name.startswith(kind)] for kind in ("bearing", "distance")]
    figure = new_figure(7.4)
    axes = figure.subplots(2, len(kinds[0]), sharex=True, sharey=True, squeeze=False)
    for side, names in zip(axes, kinds, strict=True):
        side[0].set_ylabel("R² on held-out episodes")
        for axis, name in zip(side, names, strict=False):
            draw_quantity(axis, measured, name)
        for axis in side[len(names) :]:
            axis.set_visible(False)
    add_legend(figure, [axes[0, 0]], "center", 4, 10)
    return figure


def draw_quantity(axis: Axes, measured: Measured, quantity: str) -> None:
    """Draw R² of one quantity by layer."""
    probes = measured.probes[measured.probes.quantity == quantity]
    ((value, low, high),) = probes.loc[probes.network == PIXELS, ["r2", "r2_low", "r2_high"]].to_numpy()
    axis.axhline(value, **PIXEL_STYLE)
    axis.axhspan(low, high, color=PIXEL_STYLE["color"], alpha=0.15, linewidth=0)
    x = range(len(measured.layers))
    for one in measured.networks:
        # The explained network is drawn on top.
        style = STYLES[one.role] | {"zorder": 3 if one.role is Role.explained else 2}
        axis.plot(x, probes[probes.network == one.name].r2.clip(lower=MIN_R2), **style)
    explained = probes[probes.role == Role.explained]
    axis.vlines(x, explained.r2_low.clip(lower=MIN_R2), explained.r2_high, "#000000")
    axis.plot(x, explained.shuffled_r2.clip(lower=MIN_R2), **SHUFFLED_STYLE)
    axis.set_title(quantity, fontsize=12)
    axis.set_xticks(x, measured.layers, fontsize=10)
    axis.tick_params(labelbottom=True)
    axis.set_ylim(MIN_R2 - 0.03, 1.03)
    tidy(axis, "y")


def draw_change(measured: Measured) -> Figure:
    """Draw CKA by layer of each comparison, with intervals or ranges."""
    figure = new_figure(5.2)
    axis = figure.subplots()
    found = measured.cka_by_layer()
    x = np.arange(len(measured.layers))
    # Beside each other, so that intervals can be told apart.
    for shift, (name, table) in zip(0.05 * np.arange(len(found)), found.items(), strict=True):
        style = STYLES[Role.beside if name == OTHER_SEEDS else PAIRS[name][2]] | {"label": name}
        axis.plot(x + shift, table.cka, **style)
        axis.vlines(x + shift, table.cka_low, table.cka_high, style["color"])
    axis.set_xticks(x, measured.layers, fontsize=11)
    axis.set_ylabel("CKA: 1 similar, 0 unrelated", fontsize=11)
    tidy(axis, "y")
    add_legend(figure, [axis], "center", 4, 10)
    return figure


def draw_erased(measured: Measured) -> Figure:
    """Draw how often the action changes when a thing is erased."""
    things = list(measured.erased.thing.unique())
    figure = new_figure(1.3 + 1.05 * len(things))
    axis = figure.subplots()
    offsets = np.linspace(-0.3, 0.3, len(measured.networks))
    for one, offset in zip(measured.networks, offsets, strict=True):
        rows = measured.erased[measured.erased.network == one.name]
        y = np.arange(len(rows)) + offset
        style = STYLES[one.role] | {"linestyle": "none"}
        axis.hlines(y, rows.changed_low, rows.changed_high, style["color"])
        axis.plot(rows.changed, y, **style)
    axis.set_yticks(range(len(things)), things, fontsize=11)
    axis.set_ylim(len(things) - 0.55, -0.45)
    axis.set_xlabel("share of states in which the action changes", fontsize=11)
    axis.set_xlim(-0.03, 1.0)
    tidy(axis, "x")
    add_legend(figure, [axis], "center", 4, 10)
    return figure


def show(axis: Axes, values: Floats, colours: Any, low: float, high: float) -> AxesImage:
    """Show an image without ticks and frame, with colours between two values."""
    axis.set_xticks([])
    axis.set_yticks([])
    axis.spines[:].set_visible(False)
    return axis.imshow(values, cmap=colours, vmin=low, vmax=high, interpolation="nearest")


def draw_saliency(network: DuelingNetwork, untrained: DuelingNetwork, env: ShipEnv, states: Tensor) -> Figure:
    """Draw picture, gradient, the gradient of an untrained network, and occlusion in three states.

    Their places in the episode [T + 1, 4] are fixed, so that nobody picks the best-looking pictures.
    """
    steps = [round((len(states) - 1) * share) for share in (1 / 6, 1 / 2, 5 / 6)]
    pixels = env.rasteriser(states[steps])
    actions = greedy_actions(network, pixels).tolist()
    slopes, controls = (gradient(one, pixels).double().numpy() for one in (network, untrained))
    drops = [occlusion(network, one, env.rasteriser.background).double().numpy() for one in pixels]
    limit = max(float(np.abs(drop).max()) for drop in drops) or 1.0
    figure = new_figure(10.9)
    axes = figure.subplots(len(steps), 4)
    titles = ("input", "gradient", "gradient, untrained (control)", "occlusion")
    for axis, title in zip(axes[0], titles, strict=True):
        axis.set_title(title, fontsize=12)
    for k, side in enumerate(axes):
        # One channel is drawn in grey, three in their colours.
        show(side[0], pixels[k].permute(1, 2, 0).numpy(), "gray", 0, 255)
        speed, turn = env.world.actions[actions[k]]
        side[0].set_ylabel(f"step {steps[k]}: {speed:g} m/s, {np.degrees(turn):.1f}°/s", fontsize=10)
        for axis, values in zip(side[1:3], (slopes[k], controls[k]), strict=True):
            slope = show(axis, values / (float(np.quantile(values, 0.998)) or 1.0), "cividis", 0, 1)
        drop = show(side[3], drops[k], SIGNED, -limit, limit)
        grey = pixels[k].double().mean(0).numpy() / 255
        for axis in side[1:]:
            # The outlines of the picture show positions.
            axis.contour(grey, levels=[0.5], colors="#FFFFFF", linewidths=1.6)
            axis.contour(grey, levels=[0.5], colors="#000000", linewidths=0.7)
    for image, label in (
        (drop, "occlusion: drop of the action's advantage, in Q"),
        (slope, "gradient: share of the map's 99.8th percentile"),
    ):
        figure.colorbar(image, ax=axes, location="bottom", shrink=0.5, aspect=50, pad=0.02, label=label)
    return figure
