"""Forward transfer and its interval."""

import numpy as np
import pytest

from ship_trl.study.compare import forward_transfer

# Trials of a simulation: the share that covers has a standard error of 0.005.
TRIALS = 2_000


def test_it_is_the_share_of_what_could_be_gained() -> None:
    found = forward_transfer(np.array([0.7, 0.8]), np.array([0.4, 0.6]))
    assert found.value == pytest.approx(0.5) and found.low < 0.5 < found.high
    alone = forward_transfer(np.array([0.75]), np.array([0.4, 0.6]))
    assert alone.value == pytest.approx(0.5) and np.isinf(alone.low)
    assert np.isnan(forward_transfer(np.array([0.7]), np.array([1.0, 1.2])).value)


def test_seeds_that_rise_together_leave_little_doubt_if_they_are_paired() -> None:
    baseline = np.array([0.2, 0.4, 0.6, 0.8])
    # Each gains half of what its seed leaves.
    area = baseline + (1 - baseline) / 2
    paired, apart = (forward_transfer(area, baseline, paired) for paired in (True, False))
    assert paired.value == apart.value == pytest.approx(0.5)
    assert paired.high - paired.low == pytest.approx(0.0, abs=1e-9) and apart.high - apart.low > 0.2


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("runs", [3, 10])
@pytest.mark.parametrize(
    ("area", "baseline", "spread"), [(0.7, 0.5, 0.05), (0.85, 0.8, 0.1), (0.5, 0.5, 0.1)]
)
def test_the_interval_covers_the_truth_as_often_as_it_says(
    paired: bool, runs: int, area: float, baseline: float, spread: float
) -> None:
    rng = np.random.default_rng(0)
    truth, covered, counted = (area - baseline) / (1 - baseline), 0, 0
    for _ in range(TRIALS):
        seed, one, other = rng.normal(0, spread / np.sqrt(2), (3, runs))
        shared = seed if paired else rng.normal(0, spread / np.sqrt(2), runs)
        found = forward_transfer(area + seed + one, baseline + shared + other, paired)
        counted += np.isfinite(found.value)
        covered += found.low <= truth <= found.high
    assert 0.935 < covered / counted < 0.98
