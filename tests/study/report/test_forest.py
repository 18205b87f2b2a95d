"""The forest plot: shares of what could be gained, arms in their order, own layers beside them."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from ship_trl.files.curve import GREEDY
from ship_trl.study.compare import gain
from ship_trl.study.metrics import measure
from ship_trl.study.report.gains import FOREST_METRIC, draw_forest, measure_forests
from ship_trl.study.statistics import interquartile_mean
from ship_trl.study.study import Study
from tests.study.report.seen import across, heights
from tests.study.synthetic import make_record, make_study, with_curve

PAIR = {("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FTW"): 0.9, ("pairs", "high", "FE1"): 0.7}


def drawn(study: Study) -> Figure:
    figure = draw_forest(study)
    assert figure is not None
    return figure


def test_a_gain_is_a_share_of_the_way_from_scratch_to_the_best_known_return() -> None:
    study = make_study(PAIR, seeds=6)
    (forest,) = measure_forests(study)
    scratch = [measure(run, FOREST_METRIC) for run in study.arm("pairs", "high", "scratch").values()]
    possible = 1 - interquartile_mean(np.array(scratch))
    found = gain(study, ("pairs", "high", "FTW"), ("pairs", "high", "scratch"), FOREST_METRIC)
    assert found is not None and list(forest.gains) == ["FE1", "FTW"]
    share = forest.gains["FTW"]
    for one, other in ((share.value, found.value), (share.low, found.low), (share.high, found.high)):
        assert one == pytest.approx(other / possible)
    assert share.seeds == 6 and f"could be gained: {possible:+.2f}" in forest.title


def test_arms_are_rows_and_pairs_are_panels() -> None:
    places = PAIR | {("controls", "high", "FE3-random"): 0.3} | {("pairs", "high", "FT2"): 0.6}
    places |= {("pairs", "low", arm): 0.6 for arm in ("scratch", "FE1")}
    study = make_study(places, seeds=6)
    figure = drawn(study)
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert rows == ["FE1", "FT2", "FTW", "FE3-random"]
    first, second = figure.axes
    assert first.get_position().x0 < second.get_position().x0
    # From the top down, each value on its row.
    values = {
        float(heights(line)[0]): float(across(line)[0]) for line in first.lines if line.get_marker() == "o"
    }
    (forest, _) = measure_forests(study)
    assert values[0.0] == pytest.approx(forest.gains["FE1"].value)
    assert values[2.0] == pytest.approx(forest.gains["FTW"].value) and first.yaxis_inverted()


def test_where_nothing_can_be_gained_there_is_no_panel() -> None:
    best = {
        ("pairs", "high", arm, seed): make_record(np.full(40, 1.0), "pairs", "high", arm, seed)
        for arm in ("scratch", "FE1")
        for seed in range(5)
    }
    for key, record in best.items():
        # The first evaluation too has the best known return.
        best[key] = with_curve(record, GREEDY, returns=np.full(41, record.best_known))
    assert draw_forest(Study(best)) is None
    assert draw_forest(make_study({("pairs", "high", "FE1"): 0.5})) is None


def test_an_interval_that_is_cut_off_has_an_arrow_and_a_word() -> None:
    places = {("pairs", "high", "scratch"): 0.9, ("pairs", "high", "FE1"): 0.2}
    # The arm loses many times what could be gained.
    figure = drawn(make_study(places, seeds=6))
    arrows = [line.get_marker() for line in figure.axes[0].lines if line.get_markersize() == 4]
    assert "<" in arrows and "goes on beyond the edge" in figure.legends[0].get_title().get_text()
    assert "better" in figure.axes[0].get_xlabel()
    calm = drawn(make_study(PAIR, seeds=6))
    assert "goes on" not in calm.legends[0].get_title().get_text()
