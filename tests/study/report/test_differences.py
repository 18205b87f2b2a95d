"""Differences from scratch are taken within seeds; times to the threshold are cut off at the end."""

import numpy as np
import pytest
from ship_trl.study.report.differences import differences, draw_differences
from ship_trl.study.report.ecdf import draw_times, steps

from ship_trl.study.analysis.study import Study
from ship_trl.study.plan.jobs import PAIRS
from ship_trl.study.report.figures import PAGE, TELEPHONE
from tests.study.report.seen import across, named
from tests.study.synthetic import make_record

SCRATCH, ARM = (PAIRS, "high", "scratch"), (PAIRS, "high", "FE1")


def shifted(by: float, seeds: int = 6, without: int | None = None) -> Study:
    """Seeds that differ widely, and an arm that is above each of them by as much."""
    records = {}
    for seed in range(seeds):
        scores = np.random.default_rng(seed).normal(0.1 * seed, 0.1, 100)
        records[(*SCRATCH, seed)] = make_record(scores, *SCRATCH, seed)
        if seed != without:
            records[(*ARM, seed)] = make_record(scores + by, *ARM, seed)
    return Study(records)


def test_what_is_added_to_each_seed_is_the_difference() -> None:
    x, curves = differences(shifted(0.25), ARM, SCRATCH)
    assert curves.shape == (6, len(x)) and (x[0], x[-1]) == (1, 100)
    assert curves == pytest.approx(np.full(curves.shape, 0.25))


def test_a_seed_that_one_of_them_lacks_does_not_count() -> None:
    _, curves = differences(shifted(0.25, without=3), ARM, SCRATCH)
    assert len(curves) == 5 and curves == pytest.approx(np.full(curves.shape, 0.25))
    figure = draw_differences(shifted(0.25, without=3), PAGE)
    assert figure is not None
    assert named(figure.axes[0]) == ["FE1 (5)"]


def test_without_runs_from_scratch_there_are_no_differences() -> None:
    study = shifted(0.25)
    alone = Study({key: record for key, record in study.records.items() if key[2] == "FE1"})
    assert draw_differences(alone, PAGE) is None
    assert draw_times(alone, TELEPHONE) is not None


def test_a_pair_of_small_differences_has_an_axis_of_its_own() -> None:
    small, large = shifted(0.1), shifted(2.0)
    moved = {(part, "low", arm, seed): run for (part, _, arm, seed), run in large.records.items()}
    figure = draw_differences(Study(small.records | moved), PAGE)
    assert figure is not None
    tops = [axis.get_ylim()[1] for axis in figure.axes if named(axis) == ["FE1 (6)"]]
    assert len(tops) == 2 and 0.1 < tops[0] < 0.2 and 2 < tops[1] < 3


def reaching(times: list[int | None]) -> Study:
    """Runs of 100 episodes whose score is 1 from these on; None never is."""
    records = {}
    for seed, time in enumerate(times):
        scores = np.zeros(100)
        if time is not None:
            scores[time:] = 1.0
        records[(*ARM, seed)] = make_record(scores, *ARM, seed)
    return Study(records)


def test_runs_that_never_get_there_keep_the_share_below_one() -> None:
    runs = list(reaching([10, None, 50, 30, None]).arm(*ARM).values())
    x, shares = steps(runs)
    # The mean of three episodes in a row is at 0.65 with the second or third of them.
    assert x == pytest.approx([0, 0.12, 0.32, 0.52, 1], abs=0.011)
    assert shares == pytest.approx([0, 0.2, 0.4, 0.6, 0.6])


def test_where_all_get_there_the_share_ends_at_one_and_where_none_does_at_zero() -> None:
    assert steps(list(reaching([10, 20]).arm(*ARM).values()))[1][-1] == 1
    assert set(steps(list(reaching([None, None]).arm(*ARM).values()))[1]) == {0.0}


def test_the_panel_says_how_many_of_how_many() -> None:
    figure = draw_times(reaching([10, None, 50]), PAGE)
    assert figure is not None
    assert named(figure.axes[0]) == ["FE1 2/3"]
    (line,) = [line for line in figure.axes[0].lines if len(across(line))]
    assert line.get_drawstyle() == "steps-post"
