"""The whole of it: networks, states, measurements, figures, tables and page."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Generator, Tensor

from ship_trl.explain import captions, figures, pictures
from ship_trl.explain.measure import cast, measure
from ship_trl.explain.networks import Subject, load_subjects, untrained
from ship_trl.explain.page import Drawn, render, write_figure
from ship_trl.explain.rows import Measured
from ship_trl.explain.saliency import choose, things
from ship_trl.explain.states import StateSet, draw_states
from ship_trl.explain.tables import write_tables
from ship_trl.explain.words import answers, listed, seeds
from ship_trl.files.disk import replacing
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import rollout
from ship_trl.policies.entry import Entry
from ship_trl.run.process import configure_process
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.render import Rasteriser

PAGE = "index.html"


def write(entries: list[Entry], output: Path, episodes: int, seed: int, command: str) -> None:
    """Explain the first of the entries beside the others, and write everything into a folder, the page last.

    Raises:
        ConfigError: networks that cannot be read, or a case in which no states can be drawn.
    """
    configure_process()
    begun = time.monotonic()

    def say(line: str) -> None:
        sys.stdout.write(f"{time.monotonic() - begun:5.0f} s  {line}\n")
        sys.stdout.flush()

    case, world, colour = entries[0].case, entries[0].world, entries[0].colour
    subjects = load_subjects(entries)
    # At once: what cannot be written need not be computed.
    output.mkdir(parents=True, exist_ok=True)
    network = subjects[0].network
    beside = f", beside {len(subjects) - 1} others" if len(subjects) > 1 else ""
    say(f"case {case.name}: {subjects[0].name} is explained{beside}")
    # A stream for each purpose.
    streams = [Generator().manual_seed(seed + k) for k in range(2)]
    draw = Rasteriser(case, world, colour=colour)
    drawn = draw_states(case, world, draw, lambda pixels: choose(network, pixels), episodes, streams[0])
    say(f"{len(drawn.states)} states of {episodes} episodes")
    shown = cast(subjects, untrained(network, streams[1]))
    erased = things(case, world, draw, drawn.states[torch.from_numpy(drawn.held_out)])
    measured = measure(shown, drawn, erased, seed, say)
    env = ShipEnv(case, world, 1, colour=colour)
    sailed = rollout(env, greedy_policy(network, draw))[0]
    states, titles = pictures.moments(network, world, draw, sailed.states)
    looked = pictures.look(network, shown[-1].network, draw, states, titles)
    said = answers(measured)
    middle = draw(states[1:2])[0]
    write_tables(output, measured, drawn, looked, middle)
    made = draw_all(entries[0], measured, drawn, looked, middle, output, say)
    page = render(measured, said, made, about(entries[0], subjects[0], drawn, measured, command))
    with replacing(output / PAGE) as draft:
        draft.write_text(page)
    for answer in said:
        sys.stdout.write(f"{answer.question}\n  {answer.short}\n")
    sys.stdout.write(f"{output / PAGE}\n")


def spreads(network: DuelingNetwork, pixels: Tensor) -> dict[str, Tensor]:
    """Say by layer how much each filter varies over pictures: its standard deviation, [filters]."""
    with torch.no_grad():
        given = network.activations(pixels)
    return {name: value.transpose(0, 1).flatten(1).std(1) for name, value in given.items()}


def draw_all(
    entry: Entry,
    measured: Measured,
    drawn: StateSet,
    looked: list[pictures.Looked],
    picture: Tensor,
    output: Path,
    say: Callable[[str], None],
) -> list[Drawn]:
    """Draw and write every figure."""
    network = measured.explained.network
    made = []
    for name, title, caption, figure in (
        ("probes", "What can be read from each layer", captions.PROBES, figures.draw_probes(measured)),
        ("change", "What training changed, layer by layer", captions.CHANGE, figures.draw_change(measured)),
        ("matrix", "Every two networks, layer by layer", captions.MATRIX, figures.draw_matrix(measured)),
        (
            "erased",
            "What moves the chosen action: things erased",
            captions.ERASED,
            figures.draw_erased(measured),
        ),
        (
            "saliency",
            "What moves the chosen action: pixel by pixel",
            captions.SALIENCY,
            pictures.draw_saliency(looked),
        ),
        ("filters", "Filters of the first layer", captions.FILTERS, pictures.draw_filters(measured)),
        (
            "maps",
            "What each layer gives for one picture",
            captions.MAPS,
            pictures.draw_maps(network, picture, spreads(network, drawn.pixels)),
        ),
        ("states", "The states", captions.STATES, figures.draw_places(entry.case, entry.world, drawn)),
    ):
        made.append(Drawn(title, caption, write_figure(output / f"{name}.png", figure)))
    say(f"{len(made)} figures")
    return made


def about(
    entry: Entry, subject: Subject, drawn: StateSet, measured: Measured, command: str
) -> dict[str, Any]:
    """Say what the page is about."""
    result = subject.result
    origin = f"{entry.policy}."
    if result is not None:
        origin = f"It was trained on case {result.target} (arm {result.arm}, seed {result.seed})."
    if subject.copied:
        fate = "frozen, so that CKA with the source is 1 by construction, before and after"
        if not subject.frozen:
            fate = "left to train; before training their CKA with the source is 1 by construction"
        assert result is not None
        names = listed(list(subject.copied))
        origin += f" Of its source, trained on case {result.source}, {names} were copied and {fate}."
    # With pixels and with untrained networks.
    judged = 2 * sum(row.network == measured.explained.name for row in measured.probes)
    _, arms = seeds(measured, measured.layers[0])
    return {
        "case": entry.case.name,
        "origin": origin,
        "states": len(drawn.states),
        "episodes": len(set(drawn.episode)),
        "held_out": len(set(drawn.episode[drawn.held_out])),
        "judged": judged,
        # One end of a 95 % interval.
        "by_chance": max(1, round(0.025 * judged)),
        "arms": f" of {arms}" if arms else "",
        "command": command,
    }
