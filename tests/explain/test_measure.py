"""What is measured of networks: by role, from a seed, and beside controls."""

import math
from functools import cache

import numpy as np
import pytest
import torch
from torch import Generator

from ship_trl.explain.measure import PIXELS, cast, measure, neighbours
from ship_trl.explain.networks import Subject, untrained
from ship_trl.explain.rows import Measured, Role
from ship_trl.explain.saliency import things
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from tests.explain.worlds import case_of, some_states
from tests.learn.networks import network


@cache
def small(seed: int = 0) -> Measured:
    drawn = some_states()
    first = network("single", seed=seed)
    subjects = [
        Subject("mine", first, source=network("single", seed=8), before=network("single", seed=9)),
        Subject("other", network("single", seed=7)),
    ]
    shown = cast(subjects, untrained(first, Generator().manual_seed(1)))
    held = drawn.states[torch.from_numpy(drawn.held_out)]
    erased = things(case_of(), load_world(), Rasteriser(case_of(), load_world()), held)
    said: list[str] = []
    found = measure(shown, drawn, erased, 0, said.append)
    assert len(said) == len(shown) + 2
    return found


def test_every_network_has_its_role() -> None:
    found = small()
    assert [one.role for one in found.shown] == [
        *(Role.explained, Role.before, Role.source, Role.beside),
        *[Role.untrained] * 3,
    ]
    assert len({one.name for one in found.shown}) == 7
    assert found.layers == ("conv1", "shared")


def test_the_same_seed_gives_the_same_numbers() -> None:
    first, again = small(), small.__wrapped__()
    assert first.probes == again.probes and first.alike == again.alike
    assert first.erased == again.erased and first.by_layer == again.by_layer


def test_every_reading_has_its_controls() -> None:
    found = small()
    for row in found.probes:
        assert (row.over_pixels is None) == (row.role == PIXELS)
        assert (row.over_untrained is None) == (row.role in (PIXELS, Role.untrained))
    pixels = {row.quantity: row.r2.value for row in found.probes if row.role == PIXELS}
    for row in found.probes:
        if row.over_pixels is not None:
            assert row.over_pixels.value == pytest.approx(row.r2.value - pixels[row.quantity])
            assert row.over_pixels.low <= row.over_pixels.high


def test_every_two_networks_are_compared_once() -> None:
    found = small()
    pairs = [frozenset((row.first, row.second)) for row in found.alike if row.layer == "conv1"]
    assert len(pairs) == len(set(pairs)) == 7 * 6 // 2


def test_training_is_measured_from_where_it_began() -> None:
    found = small()
    mine, before = found.explained.network, found.role(Role.before)[0].network
    (row,) = (r for r in found.by_layer if r.network == "mine" and r.layer == "conv1")
    old = before.get_parameter("conv1.weight").detach()
    apart = (mine.get_parameter("conv1.weight").detach() - old).norm() / old.norm()
    assert row.changed == pytest.approx(float(apart))
    assert all(r.changed is None for r in found.by_layer if r.network != "mine")


def test_a_filter_that_never_fires_is_silent() -> None:
    drawn = some_states()
    net = network("single")
    with torch.no_grad():
        net.get_parameter("conv1.bias")[0] = -1e6
    shown = cast([Subject("mine", net)], untrained(net, Generator().manual_seed(1)))
    held = drawn.states[torch.from_numpy(drawn.held_out)]
    erased = things(case_of(), load_world(), Rasteriser(case_of(), load_world()), held)
    found = measure(shown, drawn, erased, 0, lambda _: None)
    (row,) = (r for r in found.by_layer if r.network == "mine" and r.layer == "conv1")
    fires = net.activations(drawn.pixels)["conv1"].flatten(1) > 0
    assert row.silent == int((~fires.any(0)).sum()) >= 1


def test_neighbouring_weights_of_a_smooth_filter_correlate() -> None:
    noise = torch.randn(32, 1, 8, 8, generator=Generator().manual_seed(0))
    ramp = torch.linspace(-1, 1, 8).expand(32, 1, 8, 8) * torch.arange(1, 33)[:, None, None, None]
    drawn, smooth = (neighbours(w, np.random.default_rng(0)) for w in (noise, ramp))
    assert drawn.low < 0.05 and drawn.high > -0.1 and smooth.low > 0.7
    assert math.isnan(neighbours(torch.ones(4, 1, 8, 8), np.random.default_rng(0)).value)
