"""Networks are measured by role, from a seed, and beside controls; page tables follow from the rows."""

import dataclasses
from functools import cache

import numpy as np
import pytest
import torch
from torch import Generator

from ship_trl.explain.measure import PAIRS, PIXELS, Measured, measure
from ship_trl.explain.networks import Compared, Origin, Role, add_controls
from ship_trl.explain.page import TABLES, make_tables
from ship_trl.explain.saliency import erase_things
from ship_trl.learn.network import DuelingNetwork
from tests.explain.worlds import env_of, some_states
from tests.learn.networks import network


def measure_some(first: DuelingNetwork, origin: Origin, *others: Compared) -> Measured:
    states = some_states()
    named = [Compared("mine", Role.explained, first), *others]
    networks = add_controls(named, origin, Generator().manual_seed(1))
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


def test_the_same_seed_gives_the_same_numbers() -> None:
    first, again = measured(), measured.__wrapped__()
    assert all(getattr(first, name).equals(getattr(again, name)) for name in TABLES)


def test_every_probe_has_its_controls() -> None:
    rows = measured().probes
    is_pixels, is_untrained = rows.role == PIXELS, rows.role == Role.untrained
    assert (rows.over_pixels.isna() == is_pixels).all()
    assert (rows.over_untrained.isna() == (is_pixels | is_untrained)).all()
    pixels = rows[is_pixels].set_index("quantity").r2
    others = rows[~is_pixels]
    np.testing.assert_allclose(others.over_pixels, others.r2 - others.quantity.map(pixels))
    assert (others.over_pixels_low <= others.over_pixels_high).all()


def test_the_best_layer_is_chosen_on_validation_episodes_and_marked_against_controls() -> None:
    probes = measured().probes
    rows = probes[(probes.role == Role.explained) & (probes.quantity == "bearing of the goal")].copy()
    assert rows.layer.tolist() == ["conv1", "shared"]
    rows["checked_r2"], rows["r2"] = [0.7, 0.5], [0.1, 0.9]
    for name, values in (("over_pixels", (0.2, 0.1, 0.3)), ("over_untrained", (-0.2, -0.3, -0.1))):
        rows[[name, f"{name}_low", f"{name}_high"]] = values
    table = make_tables(dataclasses.replace(measured(), probes=rows))["probes"]
    assert table.loc[:, ["quantity", "layer"]].to_numpy().tolist() == [["bearing of the goal", "conv1"]]
    assert table["over pixels"].tolist() == ["0.20 (0.10 to 0.30) ▲"]
    assert table["over untrained"].tolist() == ["-0.20 (-0.30 to -0.10) ▼"]


def test_layers_are_compared_with_every_control() -> None:
    found = measured().cka_by_layer()
    # No two of these networks are known to differ in their seed only.
    assert list(found) == list(PAIRS)
    rows = measured().cka
    values = rows.cka[(rows.first == "mine") & (rows.second_role == Role.untrained) & (rows.layer == "conv1")]
    conv1 = found["after training, untrained"].loc["conv1"]
    assert len(values) == 3 and conv1.cka == pytest.approx(values.mean())
    assert (conv1.cka_low, conv1.cka_high) == (values.min(), values.max())
