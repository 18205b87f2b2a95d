"""Figures along the training: curves, differences within seeds, times that are cut off at the end."""

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from ship_trl.study.plan import PAIRS
from ship_trl.study.report.curves import (
    differences,
    draw_differences,
    draw_returns,
    draw_times,
    pair_sections,
    reuse_sections,
    steps,
)
from ship_trl.study.study import Study
from tests.study.report.seen import across, heights, named, outline
from tests.study.synthetic import BEST, RANDOM, make_record, make_study

ARMS = ("scratch", "FE1", "FE3", "FT2", "FTW")


def drawn(study: Study) -> Figure:
    figure = draw_returns(study, pair_sections(study, "high"))
    assert figure is not None
    return figure


def curves(axis: Axes) -> list[np.ndarray]:
    """Heights of the lines that are drawn along the episodes in the numbers of the axes."""
    lines = [line for line in axis.lines if line.get_transform() == axis.transData]
    return [heights(line) for line in lines if len(across(line)) > 2]


def bands(axis: Axes) -> list[np.ndarray]:
    return [
        outline(item)
        for item in axis.collections
        if isinstance(item, PolyCollection) and item.get_transform() == axis.transData
    ]


def row_of(axis: Axes) -> int:
    """0 for training returns, 1 for the greedy returns below them."""
    place = axis.get_subplotspec()
    assert place is not None
    return place.rowspan.start % 2


def collapsing(seeds: int = 15) -> Study:
    """Arms that are at the best but for a third of their seeds, which have collapsed."""
    records = {}
    for arm in ARMS:
        for seed in range(seeds):
            scores = np.full(120, 0.0 if seed % 3 == 0 else 1.0)
            records[PAIRS, "high", arm, seed] = make_record(scores, PAIRS, "high", arm, seed)
    return Study(records)


def test_no_band_passes_the_best_return() -> None:
    study = collapsing()
    returns = np.stack([run.training.returns for run in study.arm(PAIRS, "high", "FE1").values()])
    # What the paper's figures draw would.
    assert np.all(returns.mean(axis=0) + returns.std(axis=0, ddof=1) > BEST + 20)
    found = [band for axis in drawn(study).axes for band in bands(axis)]
    assert len(found) == 2 * 2 * 4
    assert max(band[:, 1].max() for band in found) <= BEST and min(b[:, 1].min() for b in found) >= RANDOM


@pytest.mark.parametrize(("seeds", "lines", "filled"), [(3, 6, 0), (4, 2, 2)])
def test_fewer_than_four_seeds_are_a_line_each(seeds: int, lines: int, filled: int) -> None:
    axis = drawn(collapsing(seeds)).axes[0]
    assert (len(curves(axis)), len(bands(axis))) == (lines, filled)


def test_all_panels_share_their_axes() -> None:
    axes = drawn(make_study({(PAIRS, "high", arm): 0.5 for arm in ARMS}, seeds=4)).axes
    for below in (0, 1):
        row = [axis for axis in axes if row_of(axis) == below]
        assert len({axis.get_ylim() for axis in row}) == 1 and {axis.get_xlim() for axis in row} == {(0, 120)}


def test_reuse_has_a_panel_for_each_network() -> None:
    study = make_study(
        {
            ("reuse/epsilon_low", "new", "scratch"): 0.5,
            ("reuse/epsilon_1", "new", "scratch"): 0.5,
            ("reuse/epsilon_low", "2-new", "FTW"): 0.7,
            ("reuse/epsilon_1", "2-new", "FTW"): 0.7,
            ("reuse/alone", "2-new", "FTW"): 0.7,
            ("reuse/epsilon_low", "5-new", "FTW"): 0.7,
        },
        seeds=4,
    )
    figure = draw_returns(study, reuse_sections(study))
    assert figure is not None
    names = [name for axis in figure.axes for name in named(axis)]
    epsilon = "\N{GREEK SMALL LETTER EPSILON}"
    assert names == [f"reused, {epsilon} 0.1 (4)", f"reused, {epsilon} 1 (4)", "case 2 (4)", "case 5 (4)"]
    assert all(len(curves(axis)) == 2 for axis in figure.axes)


BASE, ARM = (PAIRS, "high", "scratch"), (PAIRS, "high", "FE1")


def shifted(by: float, seeds: int = 6, without: int | None = None) -> Study:
    """Seeds that differ widely, and an arm that is above each of them by as much."""
    records = {}
    for seed in range(seeds):
        scores = np.random.default_rng(seed).normal(0.1 * seed, 0.1, 100)
        records[(*BASE, seed)] = make_record(scores, *BASE, seed)
        if seed != without:
            records[(*ARM, seed)] = make_record(scores + by, *ARM, seed)
    return Study(records)


def test_what_is_added_to_each_seed_is_the_difference() -> None:
    x, curves = differences(shifted(0.25), ARM, BASE)
    assert curves.shape == (6, len(x)) and (x[0], x[-1]) == (1, 100)
    assert curves == pytest.approx(np.full(curves.shape, 0.25))


def test_a_seed_that_one_of_them_lacks_does_not_count() -> None:
    _, curves = differences(shifted(0.25, without=3), ARM, BASE)
    assert len(curves) == 5 and curves == pytest.approx(np.full(curves.shape, 0.25))
    figure = draw_differences(shifted(0.25, without=3))
    assert figure is not None
    assert named(figure.axes[0]) == ["FE1 (5)"]


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
    assert steps(list(reaching([10, 20]).arm(*ARM).values()))[1][-1] == 1
    assert set(steps(list(reaching([None, None]).arm(*ARM).values()))[1]) == {0.0}


def test_the_panel_says_how_many_of_how_many() -> None:
    assert draw_times(reaching([None, None])) is None
    figure = draw_times(reaching([10, None, 50]))
    assert figure is not None
    assert named(figure.axes[0]) == ["FE1 2/3"]
    (line,) = [line for line in figure.axes[0].lines if len(across(line))]
    assert line.get_drawstyle() == "steps-post"
