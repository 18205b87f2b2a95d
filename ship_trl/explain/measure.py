"""Measure networks on a set of states."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.explain.bootstrap import Estimate, interval, per_episode, resamples, share
from ship_trl.explain.cka import estimate, gram
from ship_trl.explain.networks import Subject
from ship_trl.explain.probes import Reading, read
from ship_trl.explain.rows import CKARow, ErasedRow, LayerRow, Measured, ProbeRow, Role, Shown
from ship_trl.explain.saliency import Erased, choose, gradient, moved
from ship_trl.explain.states import StateSet
from ship_trl.learn.network import DuelingNetwork

Floats = NDArray[np.float64]
PIXELS = "pixels"


def cast(subjects: list[Subject], untrained: list[DuelingNetwork]) -> tuple[Shown, ...]:
    """Give every network its role: the first is explained, and its own past with it."""
    first = subjects[0]
    found = [Shown(first.name, Role.explained, first.network, first.kin)]
    if first.before is not None:
        found.append(Shown(f"{first.name} before training", Role.before, first.before))
    if first.source is not None:
        found.append(Shown(f"source of {first.name}", Role.source, first.source))
    found += [Shown(other.name, Role.beside, other.network, other.kin) for other in subjects[1:]]
    found += [Shown(f"untrained {k}", Role.untrained, one) for k, one in enumerate(untrained, 1)]
    return tuple(found)


def measure(
    shown: tuple[Shown, ...],
    drawn: StateSet,
    erased: list[Erased],
    seed: int,
    say: Callable[[str], None],
) -> Measured:
    """Measure every network on the states.

    Args:
        shown: the networks, the explained one first.
        drawn: the states.
        erased: pictures of the held-out states with things erased.
        seed: of shuffled labels and resamples.
        say: told a line of progress as each network is done.
    """
    layers = (*shown[0].network.conv_names, "shared")
    held = np.flatnonzero(drawn.held_out)
    kernels: dict[tuple[str, str], Floats] = {}
    readings: dict[tuple[str, str, str], Reading] = {}

    def probe(name: str, layer: str, kernel: Floats) -> None:
        for k, quantity in enumerate(drawn.quantities):
            # The same shuffle for every layer and network.
            generator = np.random.default_rng([seed, k])
            readings[name, layer, quantity.name] = read(kernel, quantity, drawn, generator)

    probe(PIXELS, PIXELS, gram(drawn.pixels))
    by_layer: list[LayerRow] = []
    before = next((one.network for one in shown if one.role is Role.before), None)
    for count, one in enumerate(shown, 1):
        started = time.monotonic()
        with torch.no_grad():
            activations = one.network.activations(drawn.pixels)
        for layer, given in activations.items():
            kernel = gram(given)
            probe(one.name, layer, kernel)
            kernels[one.name, layer] = kernel[np.ix_(held, held)]
            origin = before if one.role is Role.explained else None
            by_layer.append(layer_row(one, layer, given, origin, np.random.default_rng([seed, 101])))
        say(f"probes {count} of {len(shown)}: {one.name}, {time.monotonic() - started:.1f} s")
    alike = [
        CKARow(a.name, a.role, b.name, b.role, layer, a.kin is not None and a.kin == b.kin, found)
        for a, b in itertools.combinations(shown, 2)
        for layer in layers
        for found in [estimate(kernels[a.name, layer], kernels[b.name, layer], drawn.episode[held])]
    ]
    say(f"CKA of {len(shown)} networks")
    rows = probe_rows(shown, layers, drawn, readings, seed)
    moved = erased_rows(shown, drawn, erased, seed)
    say("things erased")
    return Measured(shown, layers, rows, alike, by_layer, moved)


def probe_rows(
    shown: tuple[Shown, ...],
    layers: tuple[str, ...],
    drawn: StateSet,
    readings: dict[tuple[str, str, str], Reading],
    seed: int,
) -> list[ProbeRow]:
    """Set every reading beside its controls, on the same resamples of episodes."""
    rows = []
    blank = [one.name for one in shown if one.role is Role.untrained]
    for quantity in drawn.quantities:
        pixels = readings[PIXELS, PIXELS, quantity.name]
        counts = resamples(len(pixels.errors), np.random.default_rng([seed, 102]))
        base = pixels.resampled(counts)
        rows.append(row(PIXELS, PIXELS, PIXELS, quantity.name, pixels, base, None, None))
        for layer in layers:
            controls = [readings[name, layer, quantity.name] for name in blank]
            control = np.mean([one.resampled(counts) for one in controls], axis=0)
            level = float(np.mean([one.r2 for one in controls]))
            for one in shown:
                found = readings[one.name, layer, quantity.name]
                spread = found.resampled(counts)
                over = interval(found.r2 - level, spread - control)
                rows.append(
                    row(
                        one.name,
                        one.role,
                        layer,
                        quantity.name,
                        found,
                        spread,
                        interval(found.r2 - pixels.r2, spread - base),
                        None if one.role is Role.untrained else over,
                    )
                )
    return rows


def row(
    network: str,
    role: str,
    layer: str,
    quantity: str,
    found: Reading,
    spread: Floats,
    over_pixels: Estimate | None,
    over_untrained: Estimate | None,
) -> ProbeRow:
    """Make the row of a reading."""
    r2 = interval(found.r2, spread)
    judged = (found.checked, found.shuffled, found.penalty, over_pixels, over_untrained)
    return ProbeRow(network, role, layer, quantity, r2, *judged)


def layer_row(
    one: Shown, layer: str, given: Tensor, before: DuelingNetwork | None, generator: np.random.Generator
) -> LayerRow:
    """Count filters, find the silent ones, and measure weights."""
    fires = given.flatten(2) > 0 if given.dim() > 2 else (given > 0)[:, :, None]
    weight = one.network.get_parameter(f"{layer}.weight").detach()
    changed = None
    if before is not None:
        old = before.get_parameter(f"{layer}.weight").detach()
        changed = float((weight - old).norm() / old.norm())
    silent = int((~fires.any(2).any(0)).sum())
    beside = neighbours(weight, generator) if layer == "conv1" else None
    return LayerRow(
        one.name, one.role, layer, fires.shape[1], silent, float(fires.float().mean()), changed, beside
    )


def neighbours(weight: Tensor, generator: np.random.Generator) -> Estimate:
    """Correlate neighbouring weights of filters [O, C, K, K], across and down; the interval is over filters.

    It is near zero for drawn weights, and one where each filter changes slowly from place to place.
    """
    values = (weight - weight.mean((2, 3), keepdim=True)).double()
    across, down = values[..., 1:] * values[..., :-1], values[..., 1:, :] * values[..., :-1, :]
    pairs = 0.5 * (across.mean((1, 2, 3)) + down.mean((1, 2, 3)))
    both = torch.stack((pairs, (values**2).mean((1, 2, 3))), 1).numpy()
    whole = both.sum(0)
    if whole[1] == 0:
        # Filters that are the same everywhere have no neighbours to speak of.
        return Estimate(math.nan, math.nan, math.nan)
    sums = resamples(len(both), generator) @ both
    return interval(float(whole[0] / whole[1]), sums[:, 0] / sums[:, 1])


def erased_rows(
    shown: tuple[Shown, ...], drawn: StateSet, erased: list[Erased], seed: int
) -> list[ErasedRow]:
    """Ask every network for its action with each thing erased, on held-out states."""
    held = torch.from_numpy(drawn.held_out)
    pixels, episode = drawn.pixels[held], drawn.episode[drawn.held_out]
    slopes = {one.name: gradient(one.network, pixels) for one in shown}
    chosen = {one.name: choose(one.network, pixels) for one in shown}
    rows = []
    for thing in erased:
        seen = thing.seen
        if not bool(seen.any()):
            continue
        where = episode[seen.numpy()]
        hits = {
            one.name: (choose(one.network, thing.pixels[seen]) != chosen[one.name][seen]).numpy()
            for one in shown
        }
        blank = np.mean([hits[one.name] for one in shown if one.role is Role.untrained], axis=0)
        for one in shown:
            changed = share(hits[one.name], where, np.random.default_rng([seed, 103]))
            gap = hits[one.name] - blank
            sums = per_episode(np.stack((gap, np.ones_like(gap)), 1), where)
            drawn_again = resamples(len(sums), np.random.default_rng([seed, 103])) @ sums
            over = interval(float(gap.mean()), drawn_again[:, 0] / drawn_again[:, 1])
            slope = slopes[one.name]
            rows.append(
                ErasedRow(
                    one.name,
                    one.role,
                    thing.thing,
                    int(seen.sum()),
                    changed,
                    None if one.role is Role.untrained else over,
                    moved(one.network, pixels[seen], thing.pixels[seen]),
                    float(slope[thing.where].mean() / slope[seen].mean()),
                )
            )
    return rows
