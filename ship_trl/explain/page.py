"""Explain networks: load them, draw states, measure, and write tables, figures and a page.

`page.html` holds the captions.
"""

from __future__ import annotations

import base64
import dataclasses
import math
import sys
import time
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
import numpy as np
import pandas as pd
import torch
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.typing import RcKeyType
from torch import Generator, Tensor

from ship_trl.config.errors import counted
from ship_trl.explain.measure import OTHER_SEEDS, PAIRS, PIXELS, Measured, measure
from ship_trl.explain.networks import Role, add_controls, find_origin, load_networks
from ship_trl.explain.saliency import erase_things, gradient, greedy_actions, occlusion
from ship_trl.explain.states import Floats, draw_states
from ship_trl.fast.worlds import make_env
from ship_trl.files.disk import atomic_write
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import greedy_policy, rollout
from ship_trl.policies.registry import Entry
from ship_trl.run.process import configure_process
from ship_trl.sim.env import ShipEnv
from ship_trl.view.style import CHART, Style, add_legend, save_figure

TABLES = ("probes", "cka", "erased")
MISSING = "-"
# One end of a 95 % interval.
CHANCE = 0.025
# Matplotlib's settings of all figures, which are as wide as the page: at 1,200 pixels 9 points are 12 pixels.
WIDTH = 12.0
PICTURE: dict[RcKeyType, Any] = {**CHART, "figure.dpi": 150, "axes.grid.axis": "y"}
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


def write(entries: list[Entry], output: Path, episodes: int, seed: int, command: str) -> None:
    """Explain the first network beside the others; write tables, figures and last the page into a folder.

    Raises:
        ConfigError: a network cannot be read, or no states can be drawn in the case.
    """
    configure_process()
    started = time.monotonic()

    def log(line: str) -> None:
        sys.stdout.write(f"{time.monotonic() - started:5.0f} s  {line}\n")
        sys.stdout.flush()

    named = load_networks(entries)
    name, network = named[0].name, named[0].network
    first = dataclasses.replace(entries[0], colour=network.colour)
    # Fail before the long computation if the folder cannot be written.
    output.mkdir(parents=True, exist_ok=True)
    log(f"case {first.suite.case.name}: {counted(len(named), 'network')}, {name} is explained")
    origin = find_origin(first, name)
    # One random stream for each purpose.
    state_draws, weight_draws = (Generator().manual_seed(seed + k) for k in range(2))
    vector_time = network.config.vector_time
    env = make_env(first.suite.case, first.world, 1, colour=first.colour, vector_time=vector_time)
    states = draw_states(env, network, episodes, state_draws)
    log(f"{len(states.states)} states of {episodes} episodes")
    networks = add_controls(named, origin, weight_draws)
    erased = erase_things(env, states.states[torch.from_numpy(states.held_out)])
    measured = measure(networks, states, erased, seed, log)
    for table in TABLES:
        with atomic_write(output / f"{table}.csv") as draft:
            getattr(measured, table).to_csv(draft, index=False)
    episode = rollout(env, greedy_policy(network, env.rasteriser))[0].states
    images = {}
    with matplotlib.rc_context(PICTURE):
        for key, figure in (
            ("probes", draw_probes(measured)),
            ("change", draw_change(measured)),
            ("erased", draw_erased(measured)),
            ("saliency", draw_saliency(network, networks[-1].network, env, episode)),
        ):
            save_figure(figure, output / f"{key}.png")
            images[key] = base64.b64encode((output / f"{key}.png").read_bytes()).decode()
    log(f"{len(images)} figures")
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    result, held_out = origin.result, len(set(states.episode[states.held_out]))
    # Each probe with pixels and with untrained networks.
    comparisons = 2 * int((measured.probes.role == Role.explained).sum())
    facts = {
        "network": f"{name} ({first.policy})",
        "trained on case": result and result.target,
        "source case": result and result.source,
        "copied layers": ", ".join(origin.copied),
        "all networks": ", ".join(f"{one.name} ({one.role})" for one in networks),
        "states": f"{len(states.states)} of {episodes} episodes, {held_out} of them held out",
        "probe comparisons": f"{comparisons}; by chance {CHANCE * comparisons:.1f} get a ▲",
    }
    page = environment.get_template("page.html").render(
        name=name,
        case=first.suite.case.name,
        command=command,
        facts={key: value or MISSING for key, value in facts.items()},
        tables=make_tables(measured),
        figures=images,
    )
    with atomic_write(output / "index.html") as draft:
        draft.write_text(page)
    sys.stdout.write(f"{output / 'index.html'}\n")


def make_tables(measured: Measured) -> dict[str, pd.DataFrame]:
    """Make every table, by the name that `page.html` uses."""
    probes, erased = measured.probes, measured.erased
    explained = probes[probes.role == Role.explained]
    # On held-out episodes the best of several layers would look better than it is.
    best = explained.loc[explained.groupby("quantity", sort=False).checked_r2.idxmax()]
    change = {name: number(table, "cka", "z.3f") for name, table in measured.cka_by_layer().items()}
    columns = {
        "probes": {
            "quantity": best.quantity,
            "layer": best.layer,
            "R²": number(best, "r2"),
            "over pixels": number(best, "over_pixels", mark=True),
            "over untrained": number(best, "over_untrained", mark=True),
            "R², shuffled labels": best.shuffled_r2.map("{:.2f}".format),
        },
        "cka": {"layer": measured.layers} | change,
        "erased": {
            "thing": erased.thing,
            "network": erased.network,
            "states": erased.states,
            "action changes": number(erased, "changed", ".0%"),
            "over untrained": number(erased, "over_untrained", mark=True),
        },
    }
    return {name: pd.DataFrame(table) for name, table in columns.items()}


def number(table: pd.DataFrame, name: str, form: str = "z.2f", mark: bool = False) -> list[str]:
    """Format a column of estimates with intervals; `mark` shows which intervals exclude zero."""
    cells = []
    for value, low, high in zip(*(table[name + end] for end in ("", "_low", "_high")), strict=True):
        sign = (" ▲" if low > 0 else " ▼" if high < 0 else "") if mark else ""
        text = f"{value:{form}} ({low:{form}} to {high:{form}}){sign}"
        cells.append(MISSING if math.isnan(value) else text)
    return cells


def draw_probes(measured: Measured) -> Figure:
    """Draw R² by layer of every network and control: bearings above, distances below."""
    quantities = list(measured.probes.quantity.unique())
    kinds = [[name for name in quantities if name.startswith(kind)] for kind in ("bearing", "distance")]
    figure, x = Figure((WIDTH, 7.4)), range(len(measured.layers))
    axes = figure.subplots(2, len(kinds[0]), sharex=True, sharey=True, squeeze=False)
    for side, names in zip(axes, kinds, strict=True):
        side[0].set_ylabel("R² on held-out episodes")
        for axis, quantity in zip(side, names, strict=False):
            probes = measured.probes[measured.probes.quantity == quantity]
            pixels = probes[probes.network == PIXELS].iloc[0]
            axis.axhline(pixels["r2"], **PIXEL_STYLE)
            band: Style = {"color": PIXEL_STYLE["color"], "alpha": 0.15, "linewidth": 0}
            axis.axhspan(pixels["r2_low"], pixels["r2_high"], **band)
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
        for axis in side[len(names) :]:
            axis.set_visible(False)
    add_legend(figure, [axes[0, 0]], "center", 4, 10)
    return figure


def draw_change(measured: Measured) -> Figure:
    """Draw CKA by layer of each comparison, with intervals or ranges."""
    figure = Figure((WIDTH, 5.2))
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
    add_legend(figure, [axis], "center", 4, 10)
    return figure


def draw_erased(measured: Measured) -> Figure:
    """Draw how often the action changes when a thing is erased."""
    things = list(measured.erased.thing.unique())
    figure = Figure((WIDTH, 1.3 + 1.05 * len(things)))
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
    axis.grid(visible=False, axis="y")
    axis.grid(axis="x")
    add_legend(figure, [axis], "center", 4, 10)
    return figure


def show(axis: Axes, values: Floats, colours: Any, low: float, high: float) -> AxesImage:
    """Show an image without ticks and frame, with colours between two values."""
    axis.set(xticks=[], yticks=[], frame_on=False)
    axis.grid(visible=False)
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
    figure = Figure((WIDTH, 10.9))
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
