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

import jinja2
import pandas as pd
import torch
from torch import Generator

from ship_trl.explain import figures
from ship_trl.explain.measure import Measured, measure
from ship_trl.explain.networks import Origin, Role, add_controls, find_origin, load_networks
from ship_trl.explain.saliency import erase_things
from ship_trl.explain.states import StateSet, draw_states
from ship_trl.fast.worlds import make_env
from ship_trl.files.disk import atomic_write
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.policies.entry import Entry
from ship_trl.run.process import configure_process
from ship_trl.view.style import save_figure

PAGE, TABLES = "index.html", ("probes", "cka", "erased")
MISSING = "-"
# One end of a 95 % interval.
CHANCE = 0.025


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

    first = entries[0]
    named = load_networks(entries)
    name, network = named[0].name, named[0].network
    first = dataclasses.replace(first, colour=network.colour)
    # Fail before the long computation if the folder cannot be written.
    output.mkdir(parents=True, exist_ok=True)
    log(f"case {first.case.name}: {len(named)} networks, {name} is explained")
    origin = find_origin(first, name)
    # One random stream for each purpose.
    state_draws, weight_draws = (Generator().manual_seed(seed + k) for k in range(2))
    vector_time = network.config.vector_time
    env = make_env(first.case, first.world, 1, colour=first.colour, vector_time=vector_time)
    states = draw_states(env, network, episodes, state_draws)
    log(f"{len(states.states)} states of {episodes} episodes")
    networks = add_controls(named, origin, weight_draws)
    erased = erase_things(env, states.states[torch.from_numpy(states.held_out)])
    measured = measure(networks, states, erased, seed, log)
    for table in TABLES:
        with atomic_write(output / f"{table}.csv") as draft:
            getattr(measured, table).to_csv(draft, index=False)
    episode = rollout(env, greedy_policy(network, env.rasteriser))[0].states
    drawn = {
        "probes": figures.draw_probes(measured),
        "change": figures.draw_change(measured),
        "erased": figures.draw_erased(measured),
        "saliency": figures.draw_saliency(network, networks[-1].network, env, episode),
    }
    images = {}
    for key, figure in drawn.items():
        save_figure(figure, output / f"{key}.png")
        images[key] = base64.b64encode((output / f"{key}.png").read_bytes()).decode()
    log(f"{len(drawn)} figures")
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    page = environment.get_template("page.html").render(
        name=name,
        case=first.case.name,
        command=command,
        facts=list_facts(first, origin, states, measured),
        tables=make_tables(measured),
        figures=images,
    )
    with atomic_write(output / PAGE) as draft:
        draft.write_text(page)
    sys.stdout.write(f"{output / PAGE}\n")


def list_facts(entry: Entry, origin: Origin, states: StateSet, measured: Measured) -> dict[str, str]:
    """List what was compared, and on how many states."""
    result = origin.result
    episodes, held_out = len(set(states.episode)), len(set(states.episode[states.held_out]))
    # Each probe with pixels and with untrained networks.
    comparisons = 2 * int((measured.probes.role == Role.explained).sum())
    facts = {
        "network": f"{measured.networks[0].name} ({entry.policy})",
        "trained on case": result and result.target,
        "source case": result and result.source,
        "copied layers": ", ".join(origin.copied),
        "all networks": ", ".join(f"{one.name} ({one.role})" for one in measured.networks),
        "states": f"{len(states.states)} of {episodes} episodes, {held_out} of them held out",
        "probe comparisons": f"{comparisons}; by chance {CHANCE * comparisons:.1f} get a ▲",
    }
    return {key: value or MISSING for key, value in facts.items()}


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
