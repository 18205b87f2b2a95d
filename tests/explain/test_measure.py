"""Networks are measured by role, from a seed, and beside controls; page tables follow from the rows."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
import torch
from torch import Generator

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.measure import PIXELS, measure, neighbour_correlation
from ship_trl.explain.networks import Origin, add_controls, make_untrained
from ship_trl.explain.page import make_tables
from ship_trl.explain.rows import Compared, Measured, Role
from ship_trl.explain.saliency import erase_things
from ship_trl.learn.network import DuelingNetwork
from tests.explain.worlds import env_of, some_states
from tests.learn.networks import network


def measure_some(first: DuelingNetwork, origin: Origin, *others: Compared) -> Measured:
    states = some_states()
    untrained = make_untrained(first, Generator().manual_seed(1))
    networks = add_controls([Compared("mine", Role.explained, first), *others], origin, untrained)
    erased = erase_things(env_of(), states.states[torch.from_numpy(states.held_out)])
    lines: list[str] = []
    found = measure(networks, states, erased, 0, lines.append)
    assert len(lines) == len(networks) + 2
    return found


@cache
def measured() -> Measured:
    origin = Origin(source=network("single", seed=8), before=network("single", seed=9))
    other = Compared("other", Role.beside, network("single", seed=7))
    return measure_some(network("single"), origin, other)


def test_every_network_has_its_role() -> None:
    found = measured()
    roles = [Role.explained, Role.before, Role.source, Role.beside, *[Role.untrained] * 3]
    assert [one.role for one in found.networks] == roles
    assert len({one.name for one in found.networks}) == 7
    assert found.layers == ("conv1", "shared")


def test_the_same_seed_gives_the_same_numbers() -> None:
    first, again = (dataclasses.replace(one, networks=()) for one in (measured(), measured.__wrapped__()))
    assert first == again


def test_every_probe_has_its_controls() -> None:
    found = measured()
    pixels = {row.quantity: row.r2.value for row in found.probes if row.role == PIXELS}
    for row in found.probes:
        assert (row.over_pixels is None) == (row.role == PIXELS)
        assert (row.over_untrained is None) == (row.role in (PIXELS, Role.untrained))
        if row.over_pixels is not None:
            assert row.over_pixels.value == pytest.approx(row.r2.value - pixels[row.quantity])
            assert row.over_pixels.low <= row.over_pixels.high


def test_every_pair_of_networks_is_compared_once() -> None:
    pairs = [frozenset((row.first, row.second)) for row in measured().cka if row.layer == "conv1"]
    assert len(pairs) == len(set(pairs)) == 7 * 6 // 2


def test_neighbouring_weights_of_a_smooth_filter_correlate() -> None:
    noise = torch.randn(32, 1, 8, 8, generator=Generator().manual_seed(0))
    ramp = torch.linspace(-1, 1, 8).expand(32, 1, 8, 8) * torch.arange(1, 33)[:, None, None, None]
    rough, smooth = (neighbour_correlation(w, np.random.default_rng(0)) for w in (noise, ramp))
    assert rough.low < 0.05 and rough.high > -0.1 and smooth.low > 0.7
    assert math.isnan(neighbour_correlation(torch.ones(4, 1, 8, 8), np.random.default_rng(0)).value)


def test_the_best_layer_is_chosen_on_validation_episodes_and_marked_against_controls() -> None:
    row = next(r for r in measured().explained_probes if r.over_pixels)
    above, below, around = Estimate(0.2, 0.1, 0.3), Estimate(-0.2, -0.3, -0.1), Estimate(0, -0.1, 0.1)
    rows = [
        dataclasses.replace(row, layer="conv1", checked_r2=0.7, over_pixels=above, over_untrained=below),
        dataclasses.replace(row, layer="shared", checked_r2=0.5, over_pixels=around, over_untrained=above),
        *(r for r in measured().probes if r.role == Role.untrained),
    ]
    tables = make_tables(dataclasses.replace(measured(), probes=rows))
    (best,) = tables["best"].rows
    assert best[:2] == [row.quantity, "conv1"]
    assert best[3:5] == ["0.20 (0.10 to 0.30) ▲", "-0.20 (-0.30 to -0.10) ▼"]
    assert [line[-2:] for line in tables["layers"].rows] == [["0 ▲ 1 ▼", "1 ▲ 0 ▼"], ["1 ▲ 0 ▼", "0 ▲ 0 ▼"]]
