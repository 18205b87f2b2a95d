"""How many seeds see how much."""

import numpy as np
import pytest
from scipy import stats

from ship_trl.study.analysis import statistics as s
from ship_trl.study.analysis.power import seeds_needed, seen_effect


def test_what_so_many_seeds_could_see() -> None:
    # By hand: the power of a t-test is that of a noncentral t beyond its critical value.
    effect, freedom = seen_effect(15), s.FREEDOM * (15 - 2 * 3 - 1)
    assert stats.nct.sf(stats.t.isf(0.025, freedom), freedom, effect) == pytest.approx(0.8, abs=1e-4)
    assert seen_effect(2) > seen_effect(5) > seen_effect(6) > effect
    assert seen_effect(15, 0.001) > effect and seen_effect(1) == np.inf


def test_so_many_seeds_as_are_needed_show_a_difference_four_times_in_five() -> None:
    rng = np.random.default_rng(0)
    # The standard error of 15 normal seeds, as it is on average.
    error = float(np.mean([s.standard_error(rng.normal(0, 1, 15))[0] for _ in range(2_000)]))
    needed = seeds_needed(0.5, error, 15, 0.025)
    assert needed is not None and 30 <= needed <= 60
    shown = np.mean([s.p_above(rng.normal(0.5, 1, needed)) <= 0.025 for _ in range(1_000)])
    assert 0.75 < shown < 0.9
    assert seeds_needed(0.0, error, 15, 0.025) is seeds_needed(-1, error, 15, 0.025) is None
    assert seeds_needed(1e-3, error, 15, 0.025) is seeds_needed(0.5, np.nan, 15, 0.025) is None
    assert seeds_needed(9.0, error, 15, 0.025) == 15
