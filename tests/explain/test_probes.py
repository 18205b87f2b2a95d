"""A probe reads what is there, and nothing where nothing is."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Generator

from ship_trl.explain.bootstrap import interval, per_episode, resamples, share
from ship_trl.explain.cka import gram
from ship_trl.explain.probes import Reading, predict, read
from ship_trl.explain.states import Quantity
from tests.explain.worlds import some_states


def reading(
    values: NDArray[np.float64], features: torch.Tensor, seen: NDArray[np.bool_] | None = None
) -> Reading:
    drawn = some_states()
    everywhere = np.ones(len(values), dtype=bool)
    quantity = Quantity("something", "distance", values, everywhere if seen is None else seen)
    return read(gram(features), quantity, drawn, np.random.default_rng(0))


def features(count: int = 8, seed: int = 0) -> torch.Tensor:
    return torch.randn(len(some_states().states), count, generator=Generator().manual_seed(seed))


def test_what_is_linear_is_read_and_noise_is_not() -> None:
    x = features()
    linear = (x[:, :2] * 300 + 40).double().numpy()
    assert reading(linear, x).r2 > 0.999
    assert reading(linear, features(seed=1)).r2 < 0.1
    assert reading(linear, x).shuffled < 0.1


def test_what_is_not_linear_is_not_read() -> None:
    x = features()
    assert reading((x[:, :1] ** 2).double().numpy(), x).r2 < 0.3


def test_with_more_features_than_states_noise_is_still_noise() -> None:
    assert reading(features(1, seed=2).double().numpy(), features(3000)).r2 < 0.1


def test_states_in_which_it_is_not_seen_do_not_count() -> None:
    x = features()
    values = x[:, :1].double().numpy().copy()
    seen = np.arange(len(values)) % 3 > 0
    values[~seen] = 1e6
    found = reading(values, x, seen)
    assert found.r2 > 0.999 and len(found.truth) == int((seen & some_states().held_out).sum())


def test_held_out_labels_are_never_fitted() -> None:
    drawn, x = some_states(), features()
    values = x[:, :1].double().numpy().copy()
    before = reading(values, x)
    values[drawn.held_out] *= -1
    after = reading(values, x)
    np.testing.assert_allclose(before.predicted, after.predicted)
    assert after.r2 < 0


def test_it_is_ridge_regression() -> None:
    x, y = features(5).double(), features(2, seed=3).double().numpy()
    fitted, asked = np.arange(100), np.arange(100, 130)
    design = x[fitted].numpy() - x[fitted].numpy().mean(0)
    kernel = (x @ x.T).numpy()
    scale = float((design**2).sum() / len(design))
    weights = np.linalg.solve(
        design.T @ design + 0.1 * scale * np.eye(5), design.T @ (y[fitted] - y[fitted].mean(0))
    )
    known = (x[asked].numpy() - x[fitted].numpy().mean(0)) @ weights + y[fitted].mean(0)
    np.testing.assert_allclose(predict(kernel, y, fitted, asked, [0.1])[0], known, atol=1e-8)


def test_a_layer_in_which_nothing_fires_gives_the_mean() -> None:
    found = reading(features(1).double().numpy(), torch.zeros(len(some_states().states), 3))
    assert found.r2 == pytest.approx(0, abs=0.05)


def test_r2_of_all_episodes_is_that_of_all_states() -> None:
    x = features()
    found = reading((x[:, :1] + features(1, seed=4)).double().numpy(), x)
    left = ((found.predicted - found.truth) ** 2).sum() / ((found.truth - found.truth.mean(0)) ** 2).sum()
    assert found.r2 == pytest.approx(1 - left)


def test_intervals_are_over_episodes() -> None:
    # Ten equal states of an episode tell no more than one.
    hits = np.random.default_rng(0).random(200) < 0.3
    one = share(hits, np.arange(200), np.random.default_rng(1))
    ten = share(np.repeat(hits, 10), np.repeat(np.arange(200), 10), np.random.default_rng(1))
    assert one == pytest.approx(ten)
    assert one.low < hits.mean() < one.high and 0.08 < one.high - one.low < 0.2


def test_sums_over_episodes_keep_their_order() -> None:
    sums = per_episode(np.array([[1.0], [2.0], [4.0]]), np.array([7, 3, 7]))
    assert sums.tolist() == [[2.0], [5.0]]
    counts = resamples(5, np.random.default_rng(0), 50)
    assert counts.shape == (50, 5) and (counts.sum(1) == 5).all()
    assert interval(1.0, np.linspace(0, 2, 1001)) == pytest.approx((1.0, 0.05, 1.95))
