"""Each number of a run, against its definition."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ship_trl.study import metrics
from ship_trl.study.records import Record, read_run
from tests.study.synthetic import write_run


def record(tmp_path: Path, scores: list[float], before: float = 0.0, every: int = 1) -> Record:
    return read_run(write_run(tmp_path, np.array(scores), before=before, every=every))


def test_areas_and_ends(tmp_path: Path) -> None:
    rise = record(tmp_path, [k / 100 for k in range(100)])
    assert metrics.area(rise) == pytest.approx(0.495)
    assert metrics.early_area(rise) == pytest.approx(np.mean(np.arange(20)) / 100)
    assert metrics.asymptote(rise) == pytest.approx(0.945)
    assert metrics.late_gain(rise) == pytest.approx(0.945 - 0.495)
    assert metrics.best(rise) == pytest.approx(0.99)
    # One greedy evaluation more: the one before training.
    assert metrics.greedy_area(rise) == pytest.approx(0.495 * 100 / 101)
    assert metrics.greedy_asymptote(rise) == pytest.approx(0.945)


def test_jumpstart_is_against_the_same_network_untransferred(tmp_path: Path) -> None:
    assert metrics.jumpstart(record(tmp_path, [0.5] * 10, before=0.3)) == pytest.approx(0.3)


def test_rates(tmp_path: Path) -> None:
    # A score of 0.8 is a return of 0: above is the goal.
    run = record(tmp_path, [0.1] * 60 + [0.9] * 40)
    assert metrics.collisions(run) == pytest.approx(0.6) and metrics.early_collisions(run) == 1.0
    assert metrics.success(run) == 1.0 and metrics.smallest_dcpa(run) == 60.0


def test_the_threshold_is_reached_by_a_mean_of_a_hundred(tmp_path: Path) -> None:
    run = record(tmp_path, [0.0] * 100 + [1.0] * 150)
    # 80 ones among a hundred episodes, at last after the 180th.
    assert metrics.time_to_threshold(run) == (180.0, True)
    assert len(metrics.moving_scores(run)) == 151


def test_who_never_gets_there_is_censored_at_the_end(tmp_path: Path) -> None:
    assert metrics.time_to_threshold(record(tmp_path, [0.79] * 130)) == (130.0, False)
    assert metrics.time_to_threshold(record(tmp_path / "short", [0.9] * 30)) == (30.0, True)


@given(st.lists(st.floats(-3, 1), min_size=100, max_size=160))
def test_the_moving_mean_is_the_mean(scores: list[float]) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        found = metrics.moving_scores(record(Path(folder), scores, every=50))
    wanted = [np.mean(scores[k : k + 100]) for k in range(len(scores) - 99)]
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_every_metric_is_a_finite_number(tmp_path: Path) -> None:
    run = record(tmp_path, [0.2, 0.4, 0.6])
    assert all(np.isfinite(measure(run)) for measure in metrics.METRICS.values())


def test_a_dip_is_the_largest_fall_where_exploration_ends() -> None:
    from dataclasses import replace

    from tests.study.synthetic import make_record

    def run(scores: NDArray[np.float64]) -> Record:
        made = make_record(scores, "pairs", "lowest", "FT1", 0)
        epsilon = np.maximum(0.0001, 1 - np.arange(len(scores)) / 60)
        return replace(made, training=replace(made.training, epsilon=epsilon))

    falls = run(np.array([0.8] * 60 + [0.3] * 10 + [0.8] * 30))
    assert metrics.dip(falls) == pytest.approx(0.5) and metrics.collision_rise(falls) == 1.0
    # It neither hides behind a rise nor comes from elsewhere; what only rises has none.
    assert metrics.dip(run(np.linspace(0, 0.9, 100) - 0.4 * (abs(np.arange(100) - 62) < 3))) > 0.3
    assert metrics.dip(run(np.array([0.8] * 20 + [0.1] * 10 + [0.8] * 70))) == pytest.approx(0.0)
    assert metrics.dip(run(np.linspace(0, 1, 100))) == 0.0
