"""A probe reads what a layer holds linearly, and nothing else."""

import numpy as np
import pytest
import torch
from torch import Generator, Tensor

from ship_trl.explain.encoding import (
    Probe,
    fit_probe,
    gram,
    interval,
    per_episode,
    predict,
    r2,
    resamples,
    state_mean,
)
from ship_trl.explain.states import Bools, Floats, Quantity
from tests.explain.worlds import some_states


def fit(values: Floats, features: Tensor, visible: Bools | None = None) -> Probe:
    shown = np.ones(len(values), dtype=bool) if visible is None else visible
    quantity = Quantity("something", values, shown)
    return fit_probe(gram(features), quantity, some_states(), np.random.default_rng(0))


def noise(count: int = 8, seed: int = 0) -> Tensor:
    return torch.randn(len(some_states().states), count, generator=Generator().manual_seed(seed))


def labels(features: Tensor) -> Floats:
    return features.double().numpy().copy()


def test_a_linear_function_is_read_and_nothing_else() -> None:
    x = noise()
    linear = labels(x[:, :2] * 300 + 40)
    assert fit(linear, x).r2 > 0.999
    assert fit(linear, x).shuffled_r2 < 0.1
    assert fit(linear, noise(seed=1)).r2 < 0.1
    assert fit(labels(x[:, :1] ** 2), x).r2 < 0.3
    # More features than states, and a layer without activity.
    assert fit(labels(noise(1, seed=2)), noise(3000)).r2 < 0.1
    assert fit(labels(noise(1)), torch.zeros(len(x), 3)).r2 == pytest.approx(0, abs=0.05)


def test_states_without_the_quantity_do_not_count() -> None:
    x = noise()
    values = labels(x[:, :1])
    visible = np.arange(len(values)) % 3 > 0
    values[~visible] = 1e6
    found = fit(values, x, visible)
    assert found.r2 > 0.999 and found.moments[:, 0].sum() == (visible & some_states().held_out).sum()


def test_held_out_labels_are_never_fitted() -> None:
    x = noise()
    values = labels(x[:, :1])
    before = fit(values, x)
    values[some_states().held_out] *= -1
    after = fit(values, x)
    assert before.validation_r2 == after.validation_r2 and after.r2 < 0 < before.r2


def test_it_is_ridge_regression() -> None:
    x, y = labels(noise(5)), labels(noise(2, seed=3))
    fitted, tested = np.arange(100), np.arange(100, 130)
    design = x[fitted] - x[fitted].mean(0)
    penalty = 0.1 * float((design**2).sum() / len(design))
    weights = np.linalg.solve(
        design.T @ design + penalty * np.eye(5), design.T @ (y[fitted] - y[fitted].mean(0))
    )
    known = (x[tested] - x[fitted].mean(0)) @ weights + y[fitted].mean(0)
    np.testing.assert_allclose(predict(x @ x.T, y, fitted, tested, [0.1])[0], known, atol=1e-8)


def test_r2_from_sums_over_episodes_equals_r2_of_states() -> None:
    truth, predicted = labels(noise(2)), labels(noise(2, seed=4))
    sums = np.column_stack((np.ones(len(truth)), (truth**2).sum(1), truth))
    errors, moments = (
        per_episode(values, some_states().episode) for values in (((predicted - truth) ** 2).sum(1), sums)
    )
    assert Probe(errors, moments, 0.0, 0.0).r2 == pytest.approx(r2(predicted, truth))


def test_intervals_are_over_episodes() -> None:
    # Ten equal states of an episode tell no more than one.
    hits = np.random.default_rng(0).random(200) < 0.3
    one = state_mean(hits, np.arange(200), np.random.default_rng(1))
    ten = state_mean(np.repeat(hits, 10), np.repeat(np.arange(200), 10), np.random.default_rng(1))
    assert one == pytest.approx(ten)
    assert one.low < hits.mean() < one.high and 0.08 < one.high - one.low < 0.2
    assert per_episode(np.array([[1.0], [2.0], [4.0]]), np.array([7, 3, 7])).tolist() == [[2.0], [5.0]]
    assert (resamples(5, np.random.default_rng(0), 50).sum(1) == 5).all()
    found = interval(1.0, np.linspace(0, 2, 1001))
    assert (found.value, found.low, found.high) == pytest.approx((1.0, 0.05, 1.95))
