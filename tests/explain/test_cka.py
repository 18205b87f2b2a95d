"""Centred kernel alignment has the properties that it is used for."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Generator, Tensor

from ship_trl.explain.encoding import cka, estimate_cka, gram, hsic

SEEDS = st.integers(0, 2**31)


def noise(count: int, features: int, seed: int) -> Tensor:
    return torch.randn(count, features, generator=Generator().manual_seed(seed))


@given(SEEDS)
def test_order_rotation_scale_and_shift_do_not_matter(seed: int) -> None:
    x, y = noise(40, 5, seed), noise(40, 9, seed + 1)
    rotation, _ = torch.linalg.qr(noise(9, 9, seed + 2))
    scale = 0.1 + 10 * float(torch.rand(1, generator=Generator().manual_seed(seed)))
    other = gram(scale * (y @ rotation) + 3)
    assert cka(gram(y), other) == pytest.approx(1, abs=1e-4)
    assert cka(gram(x), other) == pytest.approx(cka(gram(y), gram(x)), abs=1e-4)


@pytest.mark.parametrize("features", [5, 50, 2000])
def test_independent_noise_is_unrelated_however_many_features(features: int) -> None:
    pairs = [(gram(noise(60, features, 2 * s)), gram(noise(60, features, 2 * s + 1))) for s in range(20)]
    # The biased estimator gives about 0.97 for 2,000 features of 60 states.
    assert abs(np.mean([cka(*pair) for pair in pairs])) < 0.1


def test_hsic_has_no_bias() -> None:
    found = [hsic(gram(noise(12, 3, 2 * s)), gram(noise(12, 3, 2 * s + 1))) for s in range(400)]
    assert abs(np.mean(found)) < 3 * np.std(found) / math.sqrt(len(found))


def test_the_interval_contains_the_value_and_narrows_with_episodes() -> None:
    def width(count: int) -> float:
        x = noise(count, 4, 0)
        found = estimate_cka(gram(x), gram(x + noise(count, 4, 1)), np.repeat(np.arange(count // 5), 5))
        assert found.low <= found.value <= found.high <= 1
        return found.high - found.low

    assert 0 < width(1000) < 0.6 * width(100)
