"""Centred kernel alignment has the properties that it is used for."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Generator, Tensor

from ship_trl.explain.cka import cka, estimate, gram, hsic

SEEDS = st.integers(0, 2**31)


def noise(count: int, features: int, seed: int) -> Tensor:
    return torch.randn(count, features, generator=Generator().manual_seed(seed))


@given(SEEDS)
def test_it_is_one_with_itself_turned_scaled_and_shifted(seed: int) -> None:
    x = noise(40, 6, seed)
    turned, _ = torch.linalg.qr(noise(6, 6, seed + 1))
    scale = 0.1 + 10 * float(torch.rand(1, generator=Generator().manual_seed(seed)))
    assert cka(gram(x), gram(x)) == pytest.approx(1)
    assert cka(gram(x), gram(scale * (x @ turned) + 3)) == pytest.approx(1, abs=1e-4)


@given(SEEDS)
def test_neither_order_nor_turning_changes_it(seed: int) -> None:
    x, y = noise(30, 5, seed), noise(30, 9, seed + 1)
    turned, _ = torch.linalg.qr(noise(9, 9, seed + 2))
    known = cka(gram(x), gram(y))
    assert cka(gram(y), gram(x)) == pytest.approx(known)
    assert cka(gram(x), gram(y @ turned)) == pytest.approx(known, abs=1e-4)


@pytest.mark.parametrize("features", [5, 50, 2000])
def test_independent_noise_is_unrelated_however_many_features(features: int) -> None:
    found = [
        cka(gram(noise(60, features, 2 * seed)), gram(noise(60, features, 2 * seed + 1)))
        for seed in range(20)
    ]
    # The biased estimator gives about 0.97 for 2,000 features of 60 states.
    assert abs(np.mean(found)) < 0.1


def test_it_is_what_the_formula_says_of_much_data() -> None:
    x = noise(600, 4, 0)
    y = x @ noise(4, 4, 1) + 0.5 * noise(600, 4, 2)
    a, b = x - x.mean(0), y - y.mean(0)
    plain = float((b.T @ a).norm() ** 2 / ((a.T @ a).norm() * (b.T @ b).norm()))
    assert cka(gram(x), gram(y)) == pytest.approx(plain, abs=0.02)


def test_hsic_has_no_bias() -> None:
    found = [hsic(gram(noise(12, 3, 2 * s)), gram(noise(12, 3, 2 * s + 1))) for s in range(400)]
    assert abs(np.mean(found)) < 3 * np.std(found) / math.sqrt(len(found))


def test_a_layer_in_which_nothing_fires_is_like_nothing() -> None:
    assert math.isnan(cka(gram(torch.zeros(10, 4)), gram(noise(10, 4, 0))))


def test_the_interval_holds_the_value_and_narrows_with_the_episodes() -> None:
    def width(count: int) -> float:
        x = noise(count, 4, 0)
        y = x + noise(count, 4, 1)
        found = estimate(gram(x), gram(y), np.repeat(np.arange(count // 5), 5))
        assert found.low <= found.value <= found.high <= 1
        return found.high - found.low

    assert 0 < width(1000) < 0.6 * width(100)
