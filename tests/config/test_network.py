"""Which layers a network may have, and the sizes of their maps."""

from dataclasses import replace

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from ship_trl.config.bounds import PICTURE
from ship_trl.config.network import (
    geometry,
    linear_from,
    load_network,
    non_default_network,
    supports_incremental,
    vector_part,
)
from ship_trl.config.types import Network
from ship_trl.fast.worlds import draw_starts
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.vector import VectorObservation


def sizes(conv: list[list[int]]) -> list[int]:
    """Return the sides of the maps that torch's own layers compute."""
    found, x = [], torch.zeros(1, 1, PICTURE, PICTURE, device="meta")
    for filters, kernel, stride in conv:
        x = torch.nn.Conv2d(x.shape[1], filters, kernel, stride, device="meta")(x)
        found.append(x.shape[-1])
    return found


@given(
    layers=st.lists(st.tuples(st.integers(1, 4), st.integers(1, 20), st.integers(1, 8)), max_size=6),
    last=st.integers(1, 4),
)
def test_sides_are_those_of_torch(layers: list[tuple[int, int, int]], last: int) -> None:
    conv, side = [], PICTURE
    for filters, kernel, stride in layers:
        assume(kernel <= side)
        conv.append([filters, kernel, stride])
        side = sizes(conv)[-1]
    conv.append([last, side, 1])
    found = geometry(Network(conv, 1))
    assert [layer.side for layer in found] == sizes(conv)
    assert [layer.below for layer in found] == [PICTURE, *sizes(conv)[:-1]]
    # From there on all maps are 1 x 1. Before it, only the first layer may cover a whole map.
    flat = linear_from(found)
    assert all(layer.side == 1 and layer.whole for layer in found[flat:])
    assert not any(layer.whole for layer in found[1:flat])


@pytest.mark.parametrize(("name", "sides"), [("paper", [20, 9, 7, 1]), ("five", [20, 9, 7, 5, 1])])
def test_shipped_networks(name: str, sides: list[int]) -> None:
    layers = geometry(load_network(name))
    assert [layer.side for layer in layers] == sides
    assert linear_from(layers) == len(layers) - 1 and supports_incremental(layers)


def test_the_papers_network_is_that_of_section_3_5() -> None:
    network = load_network()
    assert network == Network([[32, 8, 4], [64, 4, 2], [64, 3, 1], [200, 7, 1]], 200)
    # Files do not name it: older ones were written before there were others.
    assert non_default_network(network) is None
    five = load_network("five")
    assert non_default_network(five) == {"conv": five.conv, "hidden": five.hidden}
    # A file names only the keys of its kind.
    assert non_default_network(load_network("vector")) == {
        "linear": [128, 128, 256, 256],
        "ships": 8,
        "per_ship": 2,
        "encounters": True,
    }


@pytest.mark.parametrize(
    ("conv", "cut"),
    [
        ([[8, 8, 4], [8, 20, 1]], True),
        ([[8, 84, 4]], False),
        ([[8, 6, 4], [8, 20, 1]], False),
        ([[8, 8, 2], [8, 39, 1]], False),
    ],
)
def test_which_layers_support_the_incremental_backend(conv: list[list[int]], cut: bool) -> None:
    assert supports_incremental(geometry(Network(conv, 1))) == cut


def test_a_network_that_sees_less_takes_its_part_of_the_numbers() -> None:
    world, whole = load_world(), load_network("vector")
    states = draw_starts(load_suite("traffic", world), world, 30, 0)
    every = VectorObservation.of(whole, world)(states)
    for part in (replace(whole, ships=3, encounters=False), replace(whole, ships=5), whole):
        seen = VectorObservation.of(part, world)(states)
        assert torch.equal(every[:, vector_part(part, whole)], seen)
