"""Charts of what was measured: probes by layer, CKA by layer and by network, things erased, the states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ship_trl.config.types import World
from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.measure import PIXELS
from ship_trl.explain.rows import Measured, Role
from ship_trl.explain.states import Bools, StateSet
from ship_trl.explain.words import pairs, seeds
from ship_trl.sim.cases import Case

Look = dict[str, Any]
# Inches across, and dots an inch: a page shows it at 1,200 pixels, so that 9 points are 12 pixels.
WIDTH, DPI = 12.0, 150
# Okabe and Ito's colours, which are told apart without colour vision; shapes and dashes do it in print.
LOOKS: dict[Role, Look] = {
    Role.explained: {"color": "#000000", "marker": "o", "linestyle": "-", "linewidth": 2.2, "markersize": 8},
    Role.before: {"color": "#D55E00", "marker": "^", "linestyle": "--", "linewidth": 1.6, "markersize": 7},
    Role.source: {"color": "#0072B2", "marker": "s", "linestyle": "-.", "linewidth": 1.6, "markersize": 6},
    Role.beside: {"color": "#009E73", "marker": "D", "linestyle": "-", "linewidth": 1.0, "markersize": 5},
    Role.untrained: {"color": "#CC79A7", "marker": "x", "linestyle": ":", "linewidth": 1.6, "markersize": 7},
}
LABELS = {
    Role.before: "the same before training",
    Role.source: "its source network",
    Role.beside: "other networks named",
    Role.untrained: "untrained networks (control)",
}
PIXEL_LOOK: Look = {"color": "#E69F00", "linestyle": (0, (6, 2)), "linewidth": 2.0}
SHUFFLED_LOOK: Look = {"color": "#666666", "marker": "+", "linestyle": "none", "markersize": 7}
# R^2 below this is drawn here.
LEAST_R2 = -0.15


def figure(height: float) -> Figure:
    """Begin a figure of the page's width."""
    return Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")


def tidy(axis: Axes) -> None:
    """Take away what a chart does not need."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="y", color="#8888", linewidth=0.5)


def bars(axis: Axes, x: float, found: Estimate, colour: str) -> None:
    """Draw an interval."""
    axis.plot([x, x], [max(found.low, LEAST_R2), found.high], color=colour, linewidth=1.4)


def draw_probes(measured: Measured) -> Figure:
    """R^2 of each quantity by layer, of every network and control."""
    quantities = list(dict.fromkeys(row.quantity for row in measured.probes))
    # Bearings above, distances below; of a case without ships side by side.
    bearings, distances = ([q for q in quantities if q.startswith(kind)] for kind in ("bearing", "distance"))
    columns = max(len(bearings), len(distances))
    rows = [bearings, distances] if columns > 1 else [bearings + distances]
    drawn = figure(1.0 + 3.2 * len(rows))
    axes = drawn.subplots(len(rows), max(2, columns), sharex=True, sharey=True, squeeze=False)
    for side, names in zip(axes, rows, strict=True):
        for axis, name in zip(side, names, strict=False):
            panel(axis, measured, name)
        for axis in side[len(names) :]:
            axis.set_visible(False)
        side[0].set_ylabel("R² on held-out episodes")
    present = [role for role in LABELS if measured.role(role)]
    handles = [
        Line2D([], [], label=measured.explained.name, **LOOKS[Role.explained]),
        *(Line2D([], [], label=LABELS[role], **LOOKS[role]) for role in present),
        Line2D([], [], label="raw pixels (control)", **PIXEL_LOOK),
        Line2D([], [], label="shuffled labels (control)", **SHUFFLED_LOOK),
    ]
    drawn.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=10, frameon=False)
    return drawn


def panel(axis: Axes, measured: Measured, quantity: str) -> None:
    """Draw one quantity."""
    rows = [row for row in measured.probes if row.quantity == quantity]
    places = {layer: k for k, layer in enumerate(measured.layers)}
    (pixels,) = (row for row in rows if row.network == PIXELS)
    axis.axhline(pixels.r2.value, **PIXEL_LOOK)
    axis.axhspan(pixels.r2.low, pixels.r2.high, color=PIXEL_LOOK["color"], alpha=0.15, linewidth=0)
    for one in reversed(measured.shown):
        line = {row.layer: row for row in rows if row.network == one.name}
        values = [max(line[layer].r2.value, LEAST_R2) for layer in measured.layers]
        axis.plot(list(places.values()), values, **LOOKS[one.role])
        if one.role is Role.explained:
            for layer, x in places.items():
                bars(axis, x, line[layer].r2, "#000000")
                axis.plot(x, max(line[layer].shuffled_r2, LEAST_R2), **SHUFFLED_LOOK)
    axis.set_title(quantity, fontsize=12)
    axis.set_xticks(list(places.values()), list(places), fontsize=10)
    axis.tick_params(labelbottom=True)
    axis.set_ylim(LEAST_R2 - 0.03, 1.03)
    tidy(axis)


def draw_change(measured: Measured) -> Figure:
    """CKA by layer: what training changed, beside what seeds change."""
    drawn = figure(5.2)
    axis = drawn.subplots()
    x = np.arange(len(measured.layers))
    name = measured.explained.name
    lines: list[tuple[str, Role, Role, Look]] = [
        (f"{name}: before and after training", Role.before, Role.explained, LOOKS[Role.explained]),
        ("source and network before training", Role.source, Role.before, LOOKS[Role.before]),
        ("source and network after training", Role.source, Role.explained, LOOKS[Role.source]),
    ]
    shift = -0.05
    for label, first, second, look in lines:
        found = [pairs(measured, first, second, layer) for layer in measured.layers]
        if all(found):
            each = [rows[0].cka for rows in found]
            axis.plot(x + shift, [one.value for one in each], label=label, **look)
            for at, one in zip(x + shift, each, strict=True):
                bars(axis, at, one, look["color"])
        shift += 0.05
    between = [seeds(measured, layer) for layer in measured.layers]
    if all(rows for rows, _ in between):
        values = [[row.cka.value for row in rows] for rows, _ in between]
        low, high = [min(each) for each in values], [max(each) for each in values]
        count = f"{len(values[0])} pairs: mean, range" if len(values[0]) > 1 else "one pair"
        label = f"two networks of {between[0][1]}, other seeds ({count})"
        look = LOOKS[Role.beside]
        axis.fill_between(x, low, high, color=look["color"], alpha=0.18, linewidth=0)
        axis.plot(x, [float(np.mean(each)) for each in values], label=label, **look)
    floor = [
        [row.cka.value for row in pairs(measured, Role.explained, Role.untrained, layer)]
        for layer in measured.layers
    ]
    axis.plot(
        x,
        [float(np.mean(each)) for each in floor],
        label=f"{name} and untrained networks (floor)",
        **LOOKS[Role.untrained],
    )
    axis.set_xticks(x, measured.layers, fontsize=11)
    axis.set_ylabel("CKA: 1 alike, 0 unrelated", fontsize=11)
    tidy(axis)
    drawn.legend(loc="outside lower center", ncols=2, fontsize=10, frameon=False)
    return drawn


def draw_matrix(measured: Measured) -> Figure:
    """CKA of every two networks, a square a layer."""
    names = [one.name for one in measured.shown]
    count = len(names)
    across = 3 if count <= 10 else 2
    down = -(-(len(measured.layers) + 1) // across)
    drawn = figure(down * WIDTH / across * 0.94)
    axes = drawn.subplots(down, across, squeeze=False).flatten()
    size = 10 if count <= 6 else 9 if count <= 8 else 8
    for axis, layer in zip(axes, measured.layers, strict=False):
        values = np.eye(count)
        for row in measured.alike:
            if row.layer == layer:
                i, j = names.index(row.first), names.index(row.second)
                values[i, j] = values[j, i] = row.cka.value
        axis.imshow(values, cmap="cividis", vmin=0, vmax=1)
        for i, j in np.ndindex(count, count):
            shade = "#000000" if values[i, j] > 0.55 else "#FFFFFF"
            text = f"{values[i, j]:.2f}".removeprefix("0") if values[i, j] < 0.995 else "1"
            axis.text(j, i, text, ha="center", va="center", color=shade, fontsize=size)
        letters = [chr(ord("A") + k) for k in range(count)]
        axis.set_xticks(range(count), letters, fontsize=10)
        axis.set_yticks(range(count), letters, fontsize=10)
        axis.set_title(layer, fontsize=12)
    legend = axes[len(measured.layers)]
    legend.axis("off")
    for k, name in enumerate(names):
        legend.text(
            0.02, 0.96 - k * min(0.1, 0.95 / count), f"{chr(ord('A') + k)}  {name}", fontsize=11, va="top"
        )
    for axis in axes[len(measured.layers) + 1 :]:
        axis.axis("off")
    return drawn


def draw_erased(measured: Measured) -> Figure:
    """How often the action is another one with a thing erased, and how large the gradient on it is."""
    names = list(dict.fromkeys(row.thing for row in measured.erased))
    drawn = figure(1.3 + 1.05 * len(names))
    axes = drawn.subplots(1, 3, sharey=True)
    offsets = np.linspace(-0.3, 0.3, len(measured.shown))
    for one, offset in zip(measured.shown, offsets, strict=True):
        look = {**LOOKS[one.role], "linestyle": "none"}
        for k, name in enumerate(names):
            (row,) = (r for r in measured.erased if r.network == one.name and r.thing == name)
            axes[0].plot([row.changed.low, row.changed.high], [k + offset] * 2, color=look["color"])
            axes[0].plot(row.changed.value, k + offset, **look)
            axes[1].plot(row.moved, k + offset, **look)
            axes[2].plot(row.gradient, k + offset, **look)
    axes[0].set_yticks(range(len(names)), names, fontsize=11)
    axes[0].set_ylim(len(names) - 0.55, -0.45)
    axes[0].set_xlabel("erased: share of states\nwith another action", fontsize=11)
    axes[0].set_xlim(-0.03, 1.0)
    axes[1].set_xlabel("erased: advantages move, over how\nthey vary between states", fontsize=11)
    axes[2].set_xlabel("gradient on its pixels,\nover that of a mean pixel", fontsize=11)
    axes[2].axvline(1.0, color="#666666", linestyle="--", linewidth=1)
    for axis in axes:
        if axis is not axes[0]:
            axis.set_xlim(0, 1.06 * axis.get_xlim()[1])
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(axis="x", color="#8888", linewidth=0.5)
    present = [role for role in LABELS if measured.role(role)]
    handles = [Line2D([], [], label=measured.explained.name, **LOOKS[Role.explained])]
    handles += [Line2D([], [], label=LABELS[role], **LOOKS[role]) for role in present]
    drawn.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=10, frameon=False)
    return drawn


def draw_places(case: Case, world: World, drawn: StateSet) -> Figure:
    """Where the states lie: places of own ship, and the goal as it is seen from them."""
    found = figure(4.6)
    axes: Sequence[Axes] = found.subplots(1, 2)
    at = drawn.states.numpy()
    goal = [q for q in drawn.quantities if q.thing == "the goal"]
    parts: tuple[tuple[str, Bools, Look], ...] = (
        ("probes are fitted on", ~drawn.held_out, {"color": "#56B4E9", "marker": "o", "s": 9}),
        ("held out", drawn.held_out, {"color": "#D55E00", "marker": "x", "s": 16, "linewidths": 0.9}),
    )
    for name, part, look in parts:
        axes[0].scatter(at[part, 0], at[part, 1], label=f"{name} ({int(part.sum())})", **look)
    axes[0].scatter(
        case.start[0], case.start[1], color="#000000", marker="s", s=60, label="start of the case", zorder=3
    )
    axes[0].scatter(case.goal[0], case.goal[1], color="#000000", marker="*", s=130, label="goal", zorder=3)
    for k, ship in enumerate(case.target_ships):
        course, way = np.radians(ship.heading), ship.speed * world.max_steps * world.dt
        end = (ship.x + way * np.cos(course), ship.y + way * np.sin(course))
        label = "way of a target ship" if k == 0 else None
        axes[0].plot(*zip((ship.x, ship.y), end, strict=True), color="#009E73", linewidth=2, label=label)
        axes[0].scatter(ship.x, ship.y, color="#009E73", marker="^", s=50, zorder=3)
    axes[0].set_aspect("equal", adjustable="datalim")
    axes[0].set_xlabel("east, m")
    axes[0].set_ylabel("north, m")
    bearing = next(q.values for q in goal if q.kind == "bearing")
    angle = np.degrees(np.arctan2(bearing[:, 0], bearing[:, 1]))
    apart = np.hypot(*(np.array(case.goal)[:, None] - at[:, :2].T))
    for name, part, look in parts:
        axes[1].scatter(angle[part], apart[part], label=name, **look)
    axes[1].set_xlabel("bearing of the goal off the bow, degrees to port")
    axes[1].set_ylabel("distance of the goal, m")
    axes[1].set_xlim(-180, 180)
    axes[1].set_xticks(range(-180, 181, 60))
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    found.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=10, frameon=False)
    return found
