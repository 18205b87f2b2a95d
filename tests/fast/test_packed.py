"""Layers computed for the ships that are there equal those of every place, with their gradients."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Generator, Tensor

from ship_trl.config.network import load_network
from ship_trl.fast.incremental import as_numpy
from ship_trl.fast.packed import Packed
from ship_trl.fast.packed_kernels import unpool
from ship_trl.learn.network import Dense, DuelingNetwork, make_network

CONFIG = load_network("vector")


def observations(count: int, seed: int) -> Tensor:
    """Return observations [count, F] of scenes with any number of ships, which stand in the first places."""
    generator = Generator().manual_seed(seed)
    seen = torch.randn(count, CONFIG.inputs, generator=generator)
    ships = seen[:, CONFIG.own_numbers :].view(count, CONFIG.ships, -1)
    taken = torch.randint(CONFIG.ships + 1, (count, 1), generator=generator) > torch.arange(CONFIG.ships)
    ships[..., -1] = 1.0
    ships *= taken[..., None]
    return seen


def gradients(network: DuelingNetwork, seen: Tensor) -> tuple[Tensor, dict[str, Tensor | None]]:
    """Return the Q-values, and the gradients of the weights for their sum of squares."""
    network.zero_grad()
    q = network(seen)
    q.square().sum().backward()
    return q.detach(), {
        name: None if p.grad is None else p.grad.clone() for name, p in network.named_parameters()
    }


@given(st.integers(1, 70), st.integers(0, 4), st.integers(0, 2**31))
def test_values_and_gradients_are_those_of_every_place(count: int, frozen: int, seed: int) -> None:
    network, seen = make_network(CONFIG, 7, Generator().manual_seed(seed)), observations(count, seed)
    network.freeze(frozen)
    wanted, wanted_gradients = gradients(network, seen)
    network.backend = Packed(torch.float32)
    q, found = gradients(network, seen)
    torch.testing.assert_close(q, wanted, rtol=1e-4, atol=1e-5)
    with torch.no_grad():
        assert torch.equal(network(seen[:, None])[:, 0], q)
    for name, gradient in wanted_gradients.items():
        assert (found[name] is None) == (gradient is None), name
        if gradient is not None:
            torch.testing.assert_close(
                found[name], gradient, rtol=1e-3, atol=1e-4 * gradient.abs().max().item()
            )


def test_in_bfloat16_it_is_as_near_as_autocast() -> None:
    network, seen = make_network(CONFIG, 7, Generator().manual_seed(0)), observations(256, 0)
    exact, wanted = gradients(network, seen)
    errors = []
    for backend in (Packed(torch.bfloat16), Dense(torch.bfloat16)):
        network.backend = backend
        q, found = gradients(network, seen)
        errors.append([torch.linalg.vector_norm(q - exact)])
        for name, gradient in wanted.items():
            one = found[name]
            assert gradient is not None and one is not None
            errors[-1].append(torch.linalg.vector_norm(one - gradient))
    assert all(0 < packed < 1.2 * dense for packed, dense in zip(*errors, strict=True))


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_changed_and_copied_weights_are_seen(dtype: torch.dtype) -> None:
    network, seen = make_network(CONFIG, 7, Generator().manual_seed(0)), observations(9, 1)
    network.backend = Packed(dtype)
    before = network(seen).detach()
    other = copy.deepcopy(network)
    assert other.backend is network.backend
    with torch.no_grad():
        other.layers[0].weight.mul_(2.0)
    assert not torch.equal(other(seen), before) and torch.equal(network(seen), before)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_a_zero_of_either_sign_passes_no_gradient(dtype: torch.dtype) -> None:
    values = torch.tensor([[0.0, -0.0, 1.0]], dtype=dtype)
    rows, into, which = torch.full((1, 3), torch.nan), torch.ones(1, 6), torch.zeros(1, 3, dtype=torch.int32)
    unpool(into.numpy(), np.array([0, 1]), which.numpy(), as_numpy(values), rows.numpy())
    assert rows.tolist() == [[0.0, 0.0, 2.0]]


def test_a_network_that_has_learned_goes_to_another_process() -> None:
    network, seen = make_network(CONFIG, 7, Generator().manual_seed(0)), observations(4, 0)
    network.backend = Packed(torch.float32)
    q, _ = gradients(network, seen)
    assert torch.equal(pickle.loads(pickle.dumps(network))(seen), q)
