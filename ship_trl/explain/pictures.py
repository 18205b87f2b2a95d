"""Pictures of networks: filters of the first layer, and saliency maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.explain.bootstrap import Floats
from ship_trl.explain.charts import new_figure
from ship_trl.explain.rows import Measured, Role
from ship_trl.explain.saliency import gradient, greedy_actions, occlusion
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.env import ShipEnv

# Blue below zero, orange above, from Okabe and Ito; in grey they differ from zero in brightness.
SIGNED = LinearSegmentedColormap.from_list("signed", ["#0072B2", "#F2F2F2", "#D55E00"])
# Keyword arguments of pictures and maps from 0 to 1.
GREY: dict[str, Any] = {"cmap": "gray", "vmin": 0, "vmax": 1, "interpolation": "nearest"}
UNIT: dict[str, Any] = GREY | {"cmap": "cividis"}


def to_image(picture: Tensor) -> Floats:
    """Convert a picture [C, 84, 84] to [84, 84], or [84, 84, 3] of colours, from 0 to 1."""
    values = picture.permute(1, 2, 0).numpy() / 255.0
    return values[:, :, 0] if values.shape[2] == 1 else values


def tile(maps: Floats, columns: int) -> Floats:
    """Arrange maps [M, S, S] in a grid, with empty lines between them."""
    side, step = maps.shape[1], maps.shape[1] + 1
    sheet = np.full((-(-len(maps) // columns) * step, columns * step), np.nan)
    for k, values in enumerate(maps):
        top, left = k // columns * step, k % columns * step
        sheet[top : top + side, left : left + side] = values
    return sheet


def show(axis: Axes, values: Floats, title: str = "", **style: Any) -> Any:
    """Show an image without ticks and frame."""
    axis.set_title(title, fontsize=11)
    axis.set_xticks([])
    axis.set_yticks([])
    axis.spines[:].set_visible(False)
    return axis.imshow(values, **style)


def draw_filters(measured: Measured) -> Figure:
    """Draw the filters of conv1: of the network, its source or its start, and an untrained one."""
    networks = [
        *measured.with_role(Role.explained),
        *(measured.with_role(Role.source) or measured.with_role(Role.before)),
        measured.with_role(Role.untrained)[0],
    ]
    weights = [
        one.network.get_parameter("conv1.weight").detach().double().mean(1).numpy() for one in networks
    ]
    columns = 8 if len(weights[0]) > 16 else 4
    figure = new_figure(11.6 / len(networks) * -(-len(weights[0]) // columns) / columns + 1.0)
    axes = figure.subplots(1, len(networks), squeeze=False, gridspec_kw={"wspace": 0.06})[0]
    # One scale for all, so that strengths can be compared.
    limit = max(float(np.abs(each).max()) for each in weights)
    style: dict[str, Any] = {"cmap": SIGNED, "vmin": -limit, "vmax": limit, "interpolation": "nearest"}
    for axis, one, each in zip(axes, networks, weights, strict=True):
        image = show(axis, tile(each, columns), one.name, **style)
    bar = figure.colorbar(image, ax=axes, orientation="horizontal", shrink=0.4, aspect=40, pad=0.03)
    bar.set_label("weight", fontsize=10)
    return figure


def draw_saliency(network: DuelingNetwork, untrained: DuelingNetwork, env: ShipEnv, states: Tensor) -> Figure:
    """Draw the picture, the gradient, that of an untrained network, and occlusion in three states.

    The states are at a sixth, a half and five sixths of an episode [T + 1, 4]: the shares are fixed, so that
    nobody picks the best-looking pictures.
    """
    steps = [round((len(states) - 1) * share) for share in (1 / 6, 1 / 2, 5 / 6)]
    pixels = env.rasteriser(states[steps])
    actions = greedy_actions(network, pixels).tolist()
    slopes, controls = (gradient(one, pixels).double().numpy() for one in (network, untrained))
    drops = [occlusion(network, one, env.rasteriser.background).double().numpy() for one in pixels]
    limit = max(float(np.abs(drop).max()) for drop in drops) or 1.0
    signed: dict[str, Any] = {"cmap": SIGNED, "vmin": -limit, "vmax": limit, "interpolation": "nearest"}
    figure = new_figure(3.02 * len(steps) + 0.9)
    # The last row holds the colour bars.
    cells = figure.add_gridspec(len(steps) + 1, 4, height_ratios=[*[1.0] * len(steps), 0.05])
    titles = ("input", "gradient", "gradient, untrained (control)", "occlusion")
    for k, step in enumerate(steps):
        axes, picture = [figure.add_subplot(cells[k, column]) for column in range(4)], to_image(pixels[k])
        show(axes[0], picture, **GREY)
        axes[0].set_ylabel(f"step {step}: {action_name(env.world, actions[k])}", fontsize=10)
        for axis, values in ((axes[1], slopes[k]), (axes[2], controls[k])):
            slope = show(axis, values / (float(np.quantile(values, 0.998)) or 1.0), **UNIT)
            outline(axis, picture)
        drop = show(axes[3], drops[k], **signed)
        outline(axes[3], picture)
        for axis, title in zip(axes, titles if k == 0 else (), strict=False):
            axis.set_title(title, fontsize=12)
    for cell, image, label in (
        (cells[-1, 1:3], slope, "share of the 99.8th percentile of the map"),
        (cells[-1, 3], drop, "drop of the action's advantage, in Q"),
    ):
        bar = figure.colorbar(image, cax=figure.add_subplot(cell), orientation="horizontal")
        bar.set_label(label, fontsize=10)
    return figure


def action_name(world: World, action: int) -> str:
    """Name an action by speed and turn."""
    speed, turn = world.actions[action]
    side = "port" if turn > 0 else "starboard"
    return f"{speed:g} m/s, " + (f"{abs(np.degrees(turn)):.1f}°/s to {side}" if turn else "straight on")


def outline(axis: Axes, picture: Floats) -> None:
    """Draw the outlines of the picture over a map, to show positions."""
    values = picture if picture.ndim == 2 else picture.mean(2)
    axis.contour(values, levels=[0.5], colors="#FFFFFF", linewidths=1.6)
    axis.contour(values, levels=[0.5], colors="#000000", linewidths=0.7)
