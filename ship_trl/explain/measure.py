"""Measure networks on a set of states: tables of probes, CKA and erased things."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.explain import encoding
from ship_trl.explain.networks import Compared, Role
from ship_trl.explain.saliency import Erased, greedy_actions
from ship_trl.explain.states import Floats, StateSet
from ship_trl.study.statistics import Estimate

# Network, role and layer of the probes on raw pixels.
PIXELS = "pixels"
# Pairs of roles whose layers are compared, in the order of the networks, and the role whose look they have.
# Other seeds are added to them.
PAIRS = {
    "source, before training": (Role.before, Role.source, Role.before),
    "before, after training": (Role.explained, Role.before, Role.explained),
    "source, after training": (Role.explained, Role.source, Role.source),
    "after training, untrained": (Role.explained, Role.untrained, Role.untrained),
}
OTHER_SEEDS = "different seeds"
Row = dict[str, Any]
# Probes of one layer by quantity.
Probes = dict[str, encoding.Probe]


@dataclass(frozen=True)
class Measured:
    """Tables of all measurements; each estimate has two more columns, `_low` and `_high`.

    Attributes:
        networks: the explained network is the first.
        layers: the conv layers and `shared`.
        probes: R² on held-out (`r2`) and validation episodes (`checked_r2`), with shuffled labels, and over
            both controls, by network, layer and quantity.
        cka: CKA of a layer of two networks; `alike` marks networks that differ only in their seed.
        erased: share of the states that show a thing in which the action changes without it.
    """

    networks: list[Compared]
    layers: tuple[str, ...]
    probes: pd.DataFrame
    cka: pd.DataFrame
    erased: pd.DataFrame

    def cka_by_layer(self) -> dict[str, pd.DataFrame]:
        """Return CKA by layer of each comparison; the interval of several pairs is their range."""
        rows = self.cka
        chosen = {
            name: rows[(rows.first_role == first) & (rows.second_role == second)]
            for name, (first, second, _) in PAIRS.items()
        }
        chosen[OTHER_SEEDS] = rows[rows.alike]
        for name, pairs in chosen.items():
            if len(pairs) > len(self.layers):
                values = pairs.groupby("layer", sort=False).cka
                chosen[name] = values.agg(cka="mean", cka_low="min", cka_high="max")
        return {name: pairs for name, pairs in chosen.items() if len(pairs)}


def measure(
    networks: list[Compared],
    states: StateSet,
    erased: list[Erased],
    seed: int,
    log: Callable[[str], None],
) -> Measured:
    """Measure every network on the states; `log` takes lines of progress.

    `erased` are pictures of the held-out states, `seed` is of shuffled labels and resamples.
    """
    layers = (*networks[0].network.layer_names, "shared")
    held_out = np.flatnonzero(states.held_out)
    kernels: dict[tuple[str, str], Floats] = {}
    probes: dict[tuple[str, str], Probes] = {}

    def fit(name: str, layer: str, values: Tensor) -> None:
        kernel = encoding.gram(values)
        # Every layer and network has the same shuffled labels.
        probes[name, layer] = {
            quantity.name: encoding.fit_probe(kernel, quantity, states, np.random.default_rng([seed, k]))
            for k, quantity in enumerate(states.quantities)
        }
        kernels[name, layer] = kernel[np.ix_(held_out, held_out)]

    fit(PIXELS, PIXELS, states.pixels)
    for count, one in enumerate(networks, 1):
        with torch.no_grad():
            activations = one.network.activations(states.pixels)
        for layer, values in activations.items():
            fit(one.name, layer, values)
        log(f"probes {count} of {len(networks)}: {one.name}")
    cka: list[Row] = []
    for a, b in itertools.combinations(networks, 2):
        alike = a.settings is not None and a.settings == b.settings
        names = {"first": a.name, "first_role": a.role, "second": b.name, "second_role": b.role}
        for layer in layers:
            both = kernels[a.name, layer], kernels[b.name, layer]
            found = encoding.estimate_cka(*both, states.episode[held_out])
            cka.append({**names, "layer": layer, "alike": alike, **found.cells("cka", "_")})
    log(f"CKA of {len(networks)} networks")
    probe_rows = judge_probes(networks, layers, probes, seed)
    erased_rows = measure_erased(networks, states, erased, seed)
    log("things erased")
    return Measured(networks, layers, *map(pd.DataFrame, (probe_rows, cka, erased_rows)))


def judge_probes(
    networks: list[Compared],
    layers: tuple[str, ...],
    probes: dict[tuple[str, str], Probes],
    seed: int,
) -> list[Row]:
    """Compare every probe with its controls, on the same resamples of episodes."""
    untrained = [one.name for one in networks if one.role is Role.untrained]
    cells = [(one.name, str(one.role), layer) for layer in layers for one in networks]
    rows = []
    for quantity, pixels in probes[PIXELS, PIXELS].items():
        counts = encoding.resamples(len(pixels.errors), np.random.default_rng([seed, 102]))
        for network, role, layer in [(PIXELS, PIXELS, PIXELS), *cells]:
            probe = probes[network, layer][quantity]
            others = () if role in (PIXELS, Role.untrained) else untrained
            controls = {
                "over_pixels": [pixels] if role != PIXELS else [],
                "over_untrained": [probes[name, layer][quantity] for name in others],
            }
            row: Row = {"network": network, "role": role, "layer": layer, "quantity": quantity}
            row |= encoding.interval(probe.r2, probe.resampled_r2(counts)).cells("r2", "_")
            row |= {"checked_r2": probe.validation_r2, "shuffled_r2": probe.shuffled_r2}
            for name, ones in controls.items():
                row |= difference(probe, ones, counts).cells(name, "_")
            rows.append(row)
    return rows


def difference(probe: encoding.Probe, controls: Sequence[encoding.Probe], counts: Floats) -> Estimate:
    """Estimate how far the R² of a probe is above the mean of its controls; unknown without controls."""
    if not controls:
        return encoding.UNKNOWN
    value = probe.r2 - float(np.mean([one.r2 for one in controls]))
    control = np.mean([one.resampled_r2(counts) for one in controls], axis=0)
    return encoding.interval(value, probe.resampled_r2(counts) - control)


def measure_erased(networks: list[Compared], states: StateSet, erased: list[Erased], seed: int) -> list[Row]:
    """Compare the greedy actions of every network with and without each thing, on held-out states."""

    def choose(pixels: Tensor) -> NDArray[np.int64]:
        return np.stack([greedy_actions(one.network, pixels).numpy() for one in networks])

    actions = choose(states.pixels[torch.from_numpy(states.held_out)])
    episodes = states.episode[states.held_out]
    is_untrained = np.array([one.role is Role.untrained for one in networks])
    rows: list[Row] = []
    for thing in erased:
        visible = thing.visible.numpy()
        if not visible.any():
            continue
        episode = episodes[visible]
        changed = choose(thing.pixels[thing.visible]) != actions[:, visible]
        control = changed[is_untrained].mean(0)
        for one, change in zip(networks, changed, strict=True):
            # The same resamples for every network and thing.
            share, over_untrained = (
                encoding.state_mean(values, episode, np.random.default_rng([seed, 103]))
                for values in (change, change - control)
            )
            if one.role is Role.untrained:
                over_untrained = encoding.UNKNOWN
            labels = {"network": one.name, "role": one.role, "thing": thing.thing, "states": len(episode)}
            rows.append(labels | share.cells("changed", "_") | over_untrained.cells("over_untrained", "_"))
    return rows
