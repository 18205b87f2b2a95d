"""Each number of a run, against its definition."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ship_trl.files.curve import TRAINING
from ship_trl.files.record import RunRecord, SourceReturns, read_whole
from ship_trl.study import metrics
from ship_trl.study.metrics import measure
from tests.study.synthetic import make_record, returns_of, with_curve, write_run


def record(tmp_path: Path, scores: list[float], before: float = 0.0, every: int = 1) -> RunRecord:
    return read_whole(write_run(tmp_path, np.array(scores), before=before, every=every))


def test_areas_and_ends(tmp_path: Path) -> None:
    rise = record(tmp_path, [k / 100 for k in range(100)])
    assert measure(rise, "area") == pytest.approx(0.495)
    assert measure(rise, "early area") == pytest.approx(np.mean(np.arange(20)) / 100)
    assert measure(rise, "asymptote") == pytest.approx(0.945)
    assert measure(rise, "best") == pytest.approx(0.99)
    # One greedy evaluation more: the one before training.
    assert measure(rise, "greedy area") == pytest.approx(0.495 * 100 / 101)
    assert measure(rise, "greedy asymptote") == pytest.approx(0.945)


def test_the_start_is_the_mean_over_draws_of_the_fresh_layers(tmp_path: Path) -> None:
    one = record(tmp_path, [0.5] * 10, before=0.3)
    assert measure(one, "start") == pytest.approx(0.3)
    drawn = replace(one, draws=returns_of(np.array([0.1, 0.2, 0.6])).tolist())
    assert measure(drawn, "start") == pytest.approx(0.3)


def test_forgetting_is_a_score_of_the_source(tmp_path: Path) -> None:
    source = SourceReturns(
        network=90.0, before=-100.0, best=20.0, final=-10.0, random=-100.0, best_known=100.0
    )
    scores = np.full(20, 0.5)
    measured = read_whole(write_run(tmp_path, scores, arm="FT3", on_source=source))
    assert measure(measured, "forgetting") == pytest.approx(0.5)
    for best_known in (None, -100.0):
        changed = replace(source, best_known=best_known)
        other = read_whole(write_run(tmp_path / str(best_known), scores, arm="FT3", on_source=changed))
        assert np.isnan(measure(other, "forgetting"))
    scratch = record(tmp_path, [0.5] * 20)
    assert metrics.metrics_of([scratch, measured]) == list(metrics.METRICS)
    # A report of runs from before there was such a measurement has the columns that it had.
    assert {*metrics.METRICS} - {*metrics.metrics_of([scratch])} == {*metrics.LATER}


def test_the_threshold_is_reached_by_a_mean_of_a_few(tmp_path: Path) -> None:
    run = record(tmp_path, [0.0] * 100 + [1.0] * 100)
    # Four ones among six episodes, 3 % of 200: at last after the 104th.
    assert metrics.time_to_threshold(run) == pytest.approx(104 / 200) and metrics.has_reached(run)
    assert metrics.time_to_threshold(run, 0.5) == pytest.approx(103 / 200)
    assert metrics.time_to_threshold(run, 0.8) == pytest.approx(105 / 200)
    assert len(metrics.moving_scores(run)) == 195


def test_who_never_gets_there_has_taken_all_the_time(tmp_path: Path) -> None:
    run = record(tmp_path, [0.64] * 130)
    assert metrics.time_to_threshold(run) == 1.0 and not metrics.has_reached(run)
    assert metrics.time_to_threshold(run, 0.5) == pytest.approx(4 / 130)


def test_total_time_counts_the_sources_episodes(tmp_path: Path) -> None:
    run = replace(record(tmp_path, [0.9] * 100), arm="FE3")
    assert run.source == "1"
    assert metrics.total_time(run) == pytest.approx(1 + metrics.time_to_threshold(run))
    reused = replace(run, part="reuse/epsilon_1", source="2")
    assert metrics.total_time(reused) == pytest.approx(2 + metrics.time_to_threshold(run))
    for alone in (replace(run, source=None), replace(run, arm="FE3-random")):
        assert metrics.total_time(alone) == metrics.time_to_threshold(run)


def test_a_run_has_fallen_that_misses_the_goal_ten_times_in_a_row_after_exploration() -> None:
    def run(late: list[float]) -> RunRecord:
        made = make_record(np.array([0.1] * 60 + late), "pairs", "low", "FT1", 0)
        epsilon = np.maximum(0.0001, 1 - np.arange(len(made.training.returns)) / 60)
        return with_curve(made, TRAINING, epsilon=epsilon)

    nine, ten = run([0.9] * 15 + [0.1] * 9 + [0.9] * 16), run([0.9] * 15 + [0.1] * 10 + [0.9] * 15)
    assert (metrics.fell(nine), metrics.fell(ten)) == (0.0, 1.0)
    assert measure(ten, "misses") == pytest.approx(10 / 40, abs=0.02)


def test_without_epsilon_the_last_tenth_counts_as_after_exploration() -> None:
    made = make_record(np.array([0.9] * 80 + [0.1] * 20), "pairs", "low", "FT1", 0)
    nan = np.full(len(made.training.returns), np.nan)
    record = with_curve(made, TRAINING, epsilon=nan)
    assert metrics.fell(record) == 1.0 and measure(record, "misses") == 1.0


@given(st.lists(st.floats(-3, 1), min_size=1, max_size=160))
def test_the_moving_mean_is_the_mean(scores: list[float]) -> None:
    made = make_record(np.array(scores), "pairs", "low", "FT1", 0)
    width = max(1, round(0.03 * len(scores)))
    wanted = [np.mean(scores[k : k + width]) for k in range(len(scores) - width + 1)]
    np.testing.assert_allclose(metrics.moving_scores(made), wanted, atol=1e-9)
    along = metrics.curve(made)
    assert len(along) == metrics.CURVE_POINTS
    np.testing.assert_allclose([along[0], along[-1]], [wanted[0], wanted[-1]], atol=1e-9)


def test_a_dip_is_the_largest_fall_where_exploration_ends() -> None:
    def run(scores: NDArray[np.float64]) -> RunRecord:
        made = make_record(scores, "pairs", "lowest", "FT1", 0)
        epsilon = np.maximum(0.0001, 1 - np.arange(len(scores)) / 60)
        return with_curve(made, TRAINING, epsilon=epsilon)

    falls = run(np.array([0.8] * 60 + [0.3] * 10 + [0.8] * 30))
    assert metrics.dip(falls) == pytest.approx(0.5) and metrics.collision_rise(falls) == 1.0
    # It neither hides behind a rise nor comes from elsewhere; what only rises has none.
    assert metrics.dip(run(np.linspace(0, 0.9, 100) - 0.4 * (abs(np.arange(100) - 62) < 3))) > 0.3
    assert metrics.dip(run(np.array([0.8] * 20 + [0.1] * 10 + [0.8] * 70))) == pytest.approx(0.0)
    assert metrics.dip(run(np.linspace(0, 1, 100))) == 0.0
