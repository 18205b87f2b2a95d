"""Explain networks: load them, draw states, measure, and write figures, tables and page."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import torch
from torch import Generator

from ship_trl.explain import charts, pictures
from ship_trl.explain.measure import measure
from ship_trl.explain.networks import add_controls, find_origin, load_networks, make_untrained
from ship_trl.explain.page import list_facts, render
from ship_trl.explain.saliency import erase_things
from ship_trl.explain.states import draw_states
from ship_trl.explain.tables import write_tables
from ship_trl.files.disk import atomic_write
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.policies.entry import Entry
from ship_trl.run.process import configure_process
from ship_trl.sim.env import ShipEnv
from ship_trl.view.chart import save

PAGE = "index.html"


def write(entries: list[Entry], output: Path, episodes: int, seed: int, command: str) -> None:
    """Explain the first network, compare it with the others, and write everything into a folder.

    The page is written last.

    Raises:
        ConfigError: networks that cannot be read, or a case in which no states can be drawn.
    """
    configure_process()
    started = time.monotonic()

    def log(line: str) -> None:
        sys.stdout.write(f"{time.monotonic() - started:5.0f} s  {line}\n")
        sys.stdout.flush()

    first = entries[0]
    named = load_networks(entries)
    network = named[0].network
    # Fail before the long computation if the folder cannot be written.
    output.mkdir(parents=True, exist_ok=True)
    log(f"case {first.case.name}: {len(named)} networks, {named[0].name} is explained")
    origin = find_origin(first, named[0].name)
    # One random stream for each purpose.
    state_draws, weight_draws = (Generator().manual_seed(seed + k) for k in range(2))
    env = ShipEnv(first.case, first.world, 1, colour=first.colour)
    states = draw_states(env, network, episodes, state_draws)
    log(f"{len(states.states)} states of {episodes} episodes")
    networks = add_controls(named, origin, make_untrained(network, weight_draws))
    erased = erase_things(env, states.states[torch.from_numpy(states.held_out)])
    measured = measure(networks, states, erased, seed, log)
    episode = rollout(env, greedy_policy(network, env.rasteriser))[0].states
    write_tables(output, measured)
    figures = {
        "probes": charts.draw_probes(measured),
        "change": charts.draw_change(measured),
        "erased": charts.draw_erased(measured),
        "saliency": pictures.draw_saliency(network, networks[-1].network, env, episode),
        "filters": pictures.draw_filters(measured),
    }
    files = {name: output / f"{name}.png" for name in figures}
    for name, figure in figures.items():
        save(figure, files[name])
    log(f"{len(figures)} figures")
    page = render(measured, list_facts(first, origin, states, measured), files, first.case.name, command)
    with atomic_write(output / PAGE) as draft:
        draft.write_text(page)
    sys.stdout.write(f"{output / PAGE}\n")
