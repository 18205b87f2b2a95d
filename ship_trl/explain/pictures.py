"""Pictures of one network: filters of the first layer, maps of each layer, saliency over what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.explain.figures import figure
from ship_trl.explain.rows import Measured, Role
from ship_trl.explain.saliency import choose, gradient, occlusion
from ship_trl.learn.network import DuelingNetwork
from ship_trl.sim.render import Rasteriser

Floats = NDArray[np.float64]
# Maps of a conv layer that are drawn: those that vary most over the states.
MAPS = 16
# Below zero blue and dark, above orange and light, from Okabe and Ito: told apart in grey too.
SIGNED = LinearSegmentedColormap.from_list("signed", ["#0072B2", "#F2F2F2", "#D55E00"])


@dataclass(frozen=True)
class Looked:
    """Saliency of a state, each [84, 84]: the picture, gradients of network and control, occlusion."""

    title: str
    picture: Floats
    gradient: Floats
    control: Floats
    fall: Floats


def grey(picture: Tensor) -> Floats:
    """Show what the network sees, [C, 84, 84] to [84, 84] or [84, 84, 3] from 0 to 1."""
    values = picture.permute(1, 2, 0).numpy() / 255.0
    return values[:, :, 0] if values.shape[2] == 1 else values


def grid(maps: Floats, columns: int, gap: float = np.nan) -> Floats:
    """Lay maps [M, S, S] beside each other, with a line between them."""
    count, side, _ = maps.shape
    rows = -(-count // columns)
    sheet = np.full((rows * (side + 1) - 1, columns * (side + 1) - 1), gap)
    for k, one in enumerate(maps):
        top, left = (k // columns) * (side + 1), (k % columns) * (side + 1)
        sheet[top : top + side, left : left + side] = one
    return sheet


def bare(axis: Axes) -> None:
    """Take ticks and frame away."""
    axis.set_xticks([])
    axis.set_yticks([])
    axis.spines[:].set_visible(False)


def draw_filters(measured: Measured) -> Figure:
    """Draw the filters of the first layer: the network's, its source's or first ones, and untrained ones."""
    wanted = [
        *measured.role(Role.explained),
        *measured.role(Role.source),
        *(measured.role(Role.before) if not measured.role(Role.source) else []),
        measured.role(Role.untrained)[0],
    ]
    weights = [one.network.get_parameter("conv1.weight").detach().double().mean(1).numpy() for one in wanted]
    columns = 8 if len(weights[0]) > 16 else 4
    drawn = figure(11.6 / len(wanted) * -(-len(weights[0]) // columns) / columns + 1.0)
    axes = drawn.subplots(1, len(wanted), squeeze=False, gridspec_kw={"wspace": 0.06})[0]
    # One scale for all, so that strengths can be compared.
    most = max(float(np.abs(each).max()) for each in weights)
    for axis, one, each in zip(axes, wanted, weights, strict=True):
        image = axis.imshow(grid(each, columns), cmap=SIGNED, vmin=-most, vmax=most, interpolation="nearest")
        axis.set_title(one.name, fontsize=11)
        bare(axis)
    bar = drawn.colorbar(image, ax=axes, orientation="horizontal", shrink=0.4, aspect=40, pad=0.03)
    bar.set_label("weight", fontsize=10)
    return drawn


def draw_maps(network: DuelingNetwork, picture: Tensor, spread: dict[str, Tensor]) -> Figure:
    """Show what each layer gives for one picture.

    Args:
        network: which.
        picture: uint8 [C, 84, 84].
        spread: by layer how much each filter varies over the states, [filters].
    """
    with torch.no_grad():
        given = {
            name: value[0].double().numpy() for name, value in network.activations(picture[None]).items()
        }
    maps = [name for name, value in given.items() if value.ndim == 3 and value.shape[-1] > 1]
    rows = [name for name in given if name not in maps]
    height = 11.0 / (1 + len(maps)) + 0.4
    drawn = figure(height + 1.05 * len(rows))
    parts: Any = drawn.subfigures(2, 1, height_ratios=(height, 1.05 * max(1, len(rows))))
    above, below = parts
    axes = above.subplots(1, 1 + len(maps), squeeze=False)[0]
    axes[0].imshow(grey(picture), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    axes[0].set_title("what it sees", fontsize=11)
    bare(axes[0])
    for axis, name in zip(axes[1:], maps, strict=True):
        order = spread[name].argsort(descending=True)[:MAPS].sort().values.numpy()
        chosen = given[name][order]
        most = chosen.max(axis=(1, 2), keepdims=True)
        image = axis.imshow(
            grid(np.divide(chosen, most, out=np.zeros_like(chosen), where=most > 0), 4),
            cmap="cividis",
            vmin=0,
            vmax=1,
            interpolation="nearest",
        )
        side = given[name].shape[-1]
        axis.set_title(f"{name}: {len(order)} of {len(given[name])}, {side} x {side}", fontsize=11)
        bare(axis)
    above.colorbar(image, ax=list(axes), shrink=0.6, pad=0.01).set_label(
        "share of the map's largest", fontsize=10
    )
    strips = below.subplots(max(1, len(rows)), 1, squeeze=False)[:, 0]
    for axis, name in zip(strips, rows, strict=False):
        values = given[name].flatten()
        axis.bar(np.arange(len(values)), values, width=1.0, color="#0072B2")
        axis.set_title(
            f"{name}: {len(values)} units, {int((values > 0).sum())} fire", fontsize=11, loc="left"
        )
        axis.set_xlim(-1, len(values))
        axis.tick_params(labelsize=9)
        axis.spines[["top", "right"]].set_visible(False)
    return drawn


def look(
    network: DuelingNetwork, untrained: DuelingNetwork, draw: Rasteriser, states: Tensor, titles: list[str]
) -> list[Looked]:
    """Compute saliency of states [N, 4]; the gradient of an untrained network is the control."""
    pixels = draw(states)
    mine, control = gradient(network, pixels), gradient(untrained, pixels)
    return [
        Looked(
            title,
            grey(pixels[k]),
            mine[k].double().numpy(),
            control[k].double().numpy(),
            occlusion(network, pixels[k], draw.background).double().numpy(),
        )
        for k, title in enumerate(titles)
    ]


def draw_saliency(looked: list[Looked]) -> Figure:
    """Draw each state large: the picture, the gradient, that of an untrained network, occlusion."""
    count = len(looked)
    drawn = figure(3.02 * count + 0.9)
    # The last row is of the scales.
    places = drawn.add_gridspec(count + 1, 4, height_ratios=[*[1.0] * count, 0.05])
    axes = np.array([[drawn.add_subplot(places[k, column]) for column in range(4)] for k in range(count)])
    heads = ("what it sees", "gradient", "gradient, untrained (control)", "occlusion")
    most = max(float(np.abs(one.fall).max()) for one in looked) or 1.0
    for row, one in zip(axes, looked, strict=True):
        row[0].imshow(one.picture, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        for axis, values in ((row[1], one.gradient), (row[2], one.control)):
            top = float(np.quantile(values, 0.998)) or 1.0
            slope = axis.imshow(values / top, cmap="cividis", vmin=0, vmax=1, interpolation="nearest")
            outline(axis, one.picture)
        fall = row[3].imshow(one.fall, cmap=SIGNED, vmin=-most, vmax=most, interpolation="nearest")
        outline(row[3], one.picture)
        row[0].set_ylabel(one.title, fontsize=10)
        for axis in row:
            bare(axis)
    for axis, head in zip(axes[0], heads, strict=True):
        axis.set_title(head, fontsize=12)
    for place, image, label in (
        (places[count, 1:3], slope, "share of the largest (99.8th percentile) of that picture"),
        (places[count, 3], fall, "fall of the action's advantage, in Q"),
    ):
        bar = drawn.colorbar(image, cax=drawn.add_subplot(place), orientation="horizontal")
        bar.set_label(label, fontsize=10)
    return drawn


def outline(axis: Axes, picture: Floats) -> None:
    """Draw the outlines of the picture over a map, so that places can be found."""
    lines = picture if picture.ndim == 2 else picture.mean(2)
    axis.contour(lines, levels=[0.5], colors="#FFFFFF", linewidths=1.6)
    axis.contour(lines, levels=[0.5], colors="#000000", linewidths=0.7)


def moments(
    network: DuelingNetwork, world: World, draw: Rasteriser, states: Tensor
) -> tuple[Tensor, list[str]]:
    """Take the states at a sixth, a half and five sixths of an episode [T + 1, 4], and name them.

    Fixed shares of the way, so that nobody chooses the pictures that look best.
    """
    places = [round((len(states) - 1) * share) for share in (1 / 6, 1 / 2, 5 / 6)]
    actions = choose(network, draw(states[places])).tolist()
    titles = [
        f"step {place}: {in_words(world, action)}" for place, action in zip(places, actions, strict=True)
    ]
    return states[places], titles


def in_words(world: World, action: int) -> str:
    """Say what an action does."""
    speed, turn = world.actions[action]
    side = "port" if turn > 0 else "starboard"
    return f"{speed:g} m/s, " + (f"{abs(np.degrees(turn)):.1f}°/s to {side}" if turn else "straight on")
