"""How many seeds see how much."""

import numpy as np
import pytest
from scipy import stats

from ship_trl.study import statistics as s
from ship_trl.study.statistics import min_detectable_effect, seeds_needed


def test_what_so_many_seeds_could_see() -> None:
    # By hand: the power of a t-test is that of a noncentral t beyond its critical value.
    effect, freedom = min_detectable_effect(15), s.FREEDOM_FACTOR * (15 - 2 * 3 - 1)
    assert stats.nct.sf(stats.t.isf(0.025, freedom), freedom, effect) == pytest.approx(0.8, abs=1e-4)
    assert min_detectable_effect(2) > min_detectable_effect(5) > min_detectable_effect(6) > effect
    assert min_detectable_effect(15, 0.001) > effect and min_detectable_effect(1) == np.inf


def standard_error_of_15() -> float:
    """Return the standard error of 15 normal seeds, as it is on average."""
    rng = np.random.default_rng(0)
    return float(np.mean([s.standard_error(rng.normal(0, 1, 15))[0] for _ in range(2_000)]))


def test_so_many_seeds_as_are_needed_show_a_difference_as_often_as_is_asked() -> None:
    rng = np.random.default_rng(1)
    error = standard_error_of_15()
    for power in (0.8, 0.95):
        needed = seeds_needed(0.5, error, 15, 0.025, power)
        assert needed is not None and 30 <= needed <= 90
        shown = np.mean([s.p_above(rng.normal(0.5, 1, needed)) <= 0.025 for _ in range(1_000)])
        assert power - 0.03 < shown < power + 0.07


@pytest.mark.parametrize("contrasts", [1, 4, 9])
def test_contrasts_that_must_all_hold_need_more(contrasts: int) -> None:
    # As `Answer.wanted` asks: differences of the margin are all seen, and none are all seen to be within it.
    rng = np.random.default_rng(2)
    needed = seeds_needed(0.5, standard_error_of_15(), 15, 0.025, 1 - 0.2 / (2 * contrasts))
    assert needed is not None
    there, none = 0, 0
    for _ in range(300):
        seeds = rng.normal(0, 1, (contrasts, needed))
        there += all(s.p_above(row + 0.5) <= 0.025 for row in seeds)
        none += all(s.p_within(row, 0.5) <= 0.025 for row in seeds)
    assert there / 300 > 0.85 and 0.73 < none / 300 < 0.95


def test_of_what_is_not_known_no_seeds_are_told() -> None:
    error = standard_error_of_15()
    told = [seeds_needed(0.5, e, 15, 0.025, 0.8) for e in (np.nan, 0.0)]
    told += [seeds_needed(d, error, 15, 0.025, 0.8) for d in (0.0, 1e-3)]
    assert told == [None] * 4
    assert seeds_needed(9.0, error, 15, 0.025, 0.8) == 5
