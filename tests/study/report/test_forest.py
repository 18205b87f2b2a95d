"""The forest plot: a row for each contrast, in its place, with its margin, interval and verdict."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from ship_trl.study.report.forest import DIFFERENCE, RATIO, START, blocks, draw_forest, limits

from ship_trl.study.analysis.contrasts import Finding, Verdict
from ship_trl.study.analysis.statistics import Estimate
from ship_trl.study.claims.kinds import Hypothesis
from ship_trl.study.claims.verdicts import Answer
from ship_trl.study.report.figures import PAGE, TELEPHONE, VERDICTS, Form
from tests.study.report.seen import across, heights, outline


def finding(value: float, reach: float = 0.05, metric: str = "area", **changes: object) -> Finding:
    estimate = Estimate(value, value - reach, value + reach)
    what = f"high: {value:+.2f} above scratch ({metric})"
    made = Finding("H1", what, metric, estimate, 0.01, 0.99, 15, margin=0.03)
    return replace(made, **changes)  # type: ignore[arg-type]


def answer(*findings: Finding, verdict: Verdict = Verdict.supported, name: str = "H1") -> Answer:
    return Answer(Hypothesis(name, "5", "A claim of some words.", []), list(findings), verdict)


def words(figure: Figure) -> list[str]:
    return [
        text.get_text() for texts in (figure.texts, *(axis.texts for axis in figure.axes)) for text in texts
    ]


def rows(axis: Axes) -> list[float]:
    """Where the estimates lie, from above."""
    marks = [line for line in axis.lines if line.get_marker() in ("^", "v", "s", "o")]
    return [float(across(line)[0]) for line in sorted(marks, key=lambda line: float(heights(line)[0]))]


@pytest.mark.parametrize("form", [PAGE, TELEPHONE])
def test_each_contrast_is_a_row_in_the_order_of_its_claim(form: Form) -> None:
    answers = [answer(finding(0.1), finding(-0.2)), answer(finding(0.05), name="H2")]
    figure = draw_forest(answers, form)
    assert figure is not None
    assert [rows(axis) for axis in figure.axes] == [[0.1, -0.2], [0.05]]
    # Claims that are on one scale can be compared by eye.
    assert len({axis.get_xlim() for axis in figure.axes}) == 1
    told = words(figure)
    assert sum("H1 supported" in text for text in told) == 1
    assert all(sum(one.what in text for text in told) == 1 for a in answers for one in a.findings)


def test_a_row_has_its_own_verdict_and_a_claim_that_of_all() -> None:
    one = finding(-0.2, verdict=Verdict.contradicted)
    other = finding(0.01, verdict=Verdict.equivalent)
    figure = draw_forest([answer(one, other, verdict=Verdict.inconclusive)], PAGE)
    assert figure is not None
    (first,) = [text for text in words(figure) if text.startswith("-0.200")]
    assert first == "-0.200 (-0.250 to -0.150) \N{BLACK DOWN-POINTING TRIANGLE} contradicted"
    assert any(text.startswith("+0.010") and text.endswith("= equivalent") for text in words(figure))
    assert any("H1 inconclusive" in text for text in words(figure))
    markers = [str(line.get_marker()) for line in figure.axes[0].lines if line.get_marker() in ("v", "s")]
    assert sorted(markers) == ["s", "v"]


def test_verdicts_differ_in_mark_and_colour() -> None:
    for column in range(3):
        assert len({look[column] for look in VERDICTS.values()}) == len(Verdict)


def test_the_margin_is_shaded_where_there_is_one() -> None:
    figure = draw_forest([answer(finding(0.1), finding(0.2, margin=None))], PAGE)
    assert figure is not None
    (shaded,) = figure.axes[0].collections
    ends = outline(shaded)[:, 0]
    assert (ends.min(), ends.max()) == (-0.03, 0.03)


def test_numbers_of_another_unit_have_axes_of_their_own() -> None:
    parts = [finding(0.1), finding(1.5, metric="spread"), finding(0.9, metric="start"), finding(0.2)]
    found = list(blocks([answer(*parts)], 80))
    assert [block.unit for block in found] == [DIFFERENCE, RATIO, START, DIFFERENCE]
    # The claim is named once.
    assert [bool(block.head) for block in found] == [True, False, False, False]
    figure = draw_forest([answer(*parts)], PAGE)
    assert figure is not None
    ends = [axis.get_xlim() for axis in figure.axes]
    assert ends[0] == ends[3] != ends[1] and ends[1][1] > 1.5


def test_an_interval_without_end_is_an_arrow_at_the_edge() -> None:
    endless = finding(0.1, estimate=Estimate(0.1, -np.inf, np.inf))
    figure = draw_forest([answer(endless, finding(0.02))], PAGE)
    assert figure is not None
    arrows = [str(line.get_marker()) for line in figure.axes[0].lines if line.get_marker() in ("<", ">")]
    assert sorted(arrows) == ["<", ">"] and any("unbounded" in text for text in words(figure))
    assert np.isfinite(figure.axes[0].get_xlim()).all()


def test_a_wide_interval_leaves_room_to_see_the_others() -> None:
    low, high = limits([finding(0.1, reach=9.0), finding(0.05)])
    assert -0.3 < low < -0.2 and 0.2 < high < 0.3
    low, high = limits([finding(0.4, reach=0.1)])
    assert low < 0 < 0.5 < high < 0.6
    low, high = limits([finding(0.0, reach=0.0)])
    assert low < 0 < high


def test_a_claim_without_runs_is_named() -> None:
    figure = draw_forest([answer(), answer(finding(0.1), name="H2")], PAGE)
    assert figure is not None and any("H1 no runs" in text for text in words(figure))
    assert draw_forest([answer()], PAGE) is None
