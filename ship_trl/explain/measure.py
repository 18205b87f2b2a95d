"""Measure networks on a set of states."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from ship_trl.explain.bootstrap import Estimate, Floats, interval, resamples, state_mean
from ship_trl.explain.cka import estimate, gram
from ship_trl.explain.probes import Probe, fit_probe
from ship_trl.explain.rows import CKARow, Compared, ErasedRow, FilterRow, Measured, ProbeRow, Role
from ship_trl.explain.saliency import Erased, greedy_actions
from ship_trl.explain.states import StateSet

# Network, role and layer of the probes on raw pixels.
PIXELS = "pixels"
# Probes by network, layer and quantity.
Probes = dict[tuple[str, str, str], Probe]


def measure(
    networks: tuple[Compared, ...],
    states: StateSet,
    erased: list[Erased],
    seed: int,
    log: Callable[[str], None],
) -> Measured:
    """Measure every network on the states.

    Args:
        networks: the networks, the explained one first.
        states: the states.
        erased: pictures of the held-out states with things erased.
        seed: of shuffled labels and resamples.
        log: takes a line of progress as each network is done.
    """
    layers = (*networks[0].network.conv_names, "shared")
    held_out = np.flatnonzero(states.held_out)
    kernels: dict[tuple[str, str], Floats] = {}
    probes: Probes = {}

    def fit_probes(name: str, layer: str, kernel: Floats) -> None:
        for k, quantity in enumerate(states.quantities):
            # The same shuffle for every layer and network.
            generator = np.random.default_rng([seed, k])
            probes[name, layer, quantity.name] = fit_probe(kernel, quantity, states, generator)

    fit_probes(PIXELS, PIXELS, gram(states.pixels))
    filters: list[FilterRow] = []
    for count, one in enumerate(networks, 1):
        started = time.monotonic()
        with torch.no_grad():
            activations = one.network.activations(states.pixels)
        for layer, values in activations.items():
            kernel = gram(values)
            fit_probes(one.name, layer, kernel)
            kernels[one.name, layer] = kernel[np.ix_(held_out, held_out)]
        weight = one.network.get_parameter("conv1.weight").detach()
        correlation = neighbour_correlation(weight, np.random.default_rng([seed, 101]))
        filters.append(FilterRow(one.name, one.role, correlation))
        log(f"probes {count} of {len(networks)}: {one.name}, {time.monotonic() - started:.1f} s")
    cka = [
        CKARow(
            a.name, a.role, b.name, b.role, layer, a.settings is not None and a.settings == b.settings, found
        )
        for a, b in itertools.combinations(networks, 2)
        for layer in layers
        for found in [estimate(kernels[a.name, layer], kernels[b.name, layer], states.episode[held_out])]
    ]
    log(f"CKA of {len(networks)} networks")
    probe_rows = judge_probes(networks, layers, states, probes, seed)
    erased_rows = measure_erased(networks, states, erased, seed)
    log("things erased")
    return Measured(networks, layers, probe_rows, cka, filters, erased_rows)


def judge_probes(
    networks: tuple[Compared, ...], layers: tuple[str, ...], states: StateSet, probes: Probes, seed: int
) -> list[ProbeRow]:
    """Compare every probe with its controls, on the same resamples of episodes."""
    rows = []
    for name in (quantity.name for quantity in states.quantities):
        pixels = probes[PIXELS, PIXELS, name]
        counts = resamples(len(pixels.errors), np.random.default_rng([seed, 102]))
        rows.append(probe_row((PIXELS, PIXELS, PIXELS, name), pixels, counts, (), ()))
        for layer in layers:
            untrained = [probes[one.name, layer, name] for one in networks if one.role is Role.untrained]
            for one in networks:
                controls = () if one.role is Role.untrained else untrained
                labels = (one.name, one.role, layer, name)
                rows.append(probe_row(labels, probes[one.name, layer, name], counts, (pixels,), controls))
    return rows


def probe_row(
    labels: tuple[str, str, str, str],
    probe: Probe,
    counts: Floats,
    pixels: Sequence[Probe],
    untrained: Sequence[Probe],
) -> ProbeRow:
    """Make the row of a probe; `labels` are network, role, layer and quantity, controls may be empty."""
    resampled = probe.resampled_r2(counts)

    def difference(controls: Sequence[Probe]) -> Estimate | None:
        if not controls:
            return None
        control = np.mean([one.resampled_r2(counts) for one in controls], axis=0)
        return interval(probe.r2 - float(np.mean([one.r2 for one in controls])), resampled - control)

    return ProbeRow(
        *labels,
        interval(probe.r2, resampled),
        probe.validation_r2,
        probe.shuffled_r2,
        difference(pixels),
        difference(untrained),
    )


def neighbour_correlation(weight: Tensor, generator: np.random.Generator) -> Estimate:
    """Correlate neighbouring weights of filters [O, C, K, K], across and down, with an interval over filters.

    It is near 0 for untrained weights and 1 for filters that change slowly from place to place.
    """
    values = (weight - weight.mean((2, 3), keepdim=True)).double()
    across, down = values[..., 1:] * values[..., :-1], values[..., 1:, :] * values[..., :-1, :]
    covariance = 0.5 * (across.mean((1, 2, 3)) + down.mean((1, 2, 3)))
    moments = torch.stack((covariance, (values**2).mean((1, 2, 3))), 1).numpy()
    whole = moments.sum(0)
    if whole[1] == 0:
        # Constant filters have no correlation.
        return Estimate(math.nan, math.nan, math.nan)
    sums = resamples(len(moments), generator) @ moments
    return interval(float(whole[0] / whole[1]), sums[:, 0] / sums[:, 1])


def measure_erased(
    networks: tuple[Compared, ...], states: StateSet, erased: list[Erased], seed: int
) -> list[ErasedRow]:
    """Compare the greedy actions of every network with and without each thing, on held-out states."""
    held_out = torch.from_numpy(states.held_out)
    pixels, episodes = states.pixels[held_out], states.episode[states.held_out]
    actions = {one.name: greedy_actions(one.network, pixels) for one in networks}
    rows = []
    for thing in erased:
        visible = thing.visible
        if not bool(visible.any()):
            continue
        episode, without = episodes[visible.numpy()], thing.pixels[visible]
        changed = {
            one.name: (greedy_actions(one.network, without) != actions[one.name][visible]).numpy()
            for one in networks
        }
        untrained = np.mean([changed[one.name] for one in networks if one.role is Role.untrained], axis=0)
        for one in networks:
            # The same resamples for every network and thing.
            share, over_untrained = (
                state_mean(values, episode, np.random.default_rng([seed, 103]))
                for values in (changed[one.name], changed[one.name] - untrained)
            )
            rows.append(
                ErasedRow(
                    one.name,
                    one.role,
                    thing.thing,
                    states=int(visible.sum()),
                    changed=share,
                    over_untrained=None if one.role is Role.untrained else over_untrained,
                )
            )
    return rows
