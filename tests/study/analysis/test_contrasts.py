"""A contrast of known truth: what is claimed of it, and what speaks for and against."""

import numpy as np
import pytest

from ship_trl.study.compare import Claimed, Finding, contrast
from ship_trl.study.statistics import min_detectable_effect


def measured(
    mean: float,
    sd: float = 0.05,
    margin: float | None = 0.05,
    claimed: Claimed = Claimed.above,
) -> Finding:
    values = np.random.default_rng(0).normal(mean, sd, 15)
    return contrast("a above b", "area", values, margin, claimed)


def test_p_speaks_for_what_is_claimed_and_against_it() -> None:
    yes, no = measured(0.3), measured(-0.3)
    assert yes.p < 0.001 < 0.999 < yes.against and yes.estimate.low > 0 and yes.as_claimed
    assert no.against < 0.001 < 0.999 < no.p and no.estimate.high < 0 and not no.as_claimed
    assert yes.seeds == 15 and yes.within > 0.9


@pytest.mark.parametrize(("mean", "held"), [(-0.9, True), (0.0, True), (0.049, True), (0.2, False)])
def test_no_more_looks_to_one_side_of_the_margin(mean: float, held: bool) -> None:
    found = measured(mean, sd=0.0001, claimed=Claimed.no_more)
    assert (found.p < 0.025) is held is found.as_claimed
    assert (found.against < 0.025) is not held


def test_no_more_without_a_margin_says_nothing() -> None:
    found = measured(-0.9, margin=None, claimed=Claimed.no_more)
    assert (found.p, found.against) == (1.0, 1.0)


def test_what_could_have_been_seen_grows_with_the_figure() -> None:
    one = measured(0.0)
    assert (
        one.min_detectable() == pytest.approx(min_detectable_effect(15) * one.error)
        and one.min_detectable(0.025 / 9) > one.min_detectable()
    )
