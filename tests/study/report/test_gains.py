"""The maps of gains: what is compared with what, and what a cell says."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from ship_trl.study.compare import gain
from ship_trl.study.report.gains import MIDDLE_LUMINANCE, draw_gains, luminance, measure_gains
from ship_trl.study.study import Study
from tests.study.synthetic import GAIN, make_study, told

PAIR = {("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7}
REUSED = {
    ("reuse/epsilon_low", "new", "scratch"): 0.5,
    ("reuse/epsilon_low", "2-new", "FTW"): 0.8,
    ("reuse/alone", "2-new", "FTW"): 0.7,
}


def drawn(study: Study, metric: str = "area") -> Figure:
    figure = draw_gains(study, metric)
    assert figure is not None
    return figure


def cells(figure: Figure) -> list[str]:
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def with_source(study: Study, sources: dict[str, str]) -> Study:
    records = {key: told(one, source=sources.get(key[1])) for key, one in study.records.items()}
    return replace(study, records=records)


def test_a_case_to_itself_may_be_a_pair_or_a_control() -> None:
    places = {("pairs", "self", "scratch"): 0.5, ("pairs", "self", "FE1"): 0.7}
    as_pair = measure_gains(with_source(make_study(places, seeds=2), {"self": "2"}), "area")
    places = {("pairs", "high", "scratch"): 0.5, ("controls", "self", "FE1"): 0.7}
    as_control = measure_gains(with_source(make_study(places, seeds=2), {"self": "2"}), "area")
    for found in (as_pair, as_control):
        assert list(found) == ["2 to 2"] and found["2 to 2"]["FE1"].value > 0.1


def test_reuse_lies_apart_and_no_column_is_blank() -> None:
    places = {**PAIR, **REUSED, ("pairs", "low", "scratch"): 0.5, ("pairs", "low", "FE1"): 0.6}
    # The arms of pair low have no seed in common.
    study = make_study(places, seeds=3)
    for key in list(study.records):
        if key[1] == "low" and (key[2] == "scratch") == (key[3] == 0):
            del study.records[key]
    found = measure_gains(with_source(study, {"high": "8", "low": "9"}), "area")
    assert list(found) == ["8 to 2", "new"] and list(found["8 to 2"]) == ["FE1"]
    assert list(found["new"]) == ["reused, \N{GREEK SMALL LETTER EPSILON} 0.1", "case 2"]


def test_a_cell_says_how_sure_its_number_is_and_what_could_be_gained() -> None:
    study = make_study({**PAIR, **REUSED}, seeds=6)
    shown = cells(drawn(study))
    found = gain(study, ("pairs", "high", "FE1"), ("pairs", "high", "scratch"))
    assert found and found.low < found.value < found.high
    assert f"{found.value:+.2f}" in shown and f"{found.low:+.2f} to {found.high:+.2f}" in shown
    # Three cells of a number and its interval, and what could be gained on case 2.
    assert len(shown) == 7 and f"{GAIN['area']:+.2f}" in shown
    assert len(cells(drawn(study, "greedy area"))) == 6


def test_bold_and_brackets_are_explained_in_the_figure() -> None:
    study = make_study({**PAIR, ("pairs", "high", "FE2"): 0.7}, seeds=6)
    for key in list(study.records):
        if key[2] == "FE2" and key[3] > 2:
            del study.records[key]
    figure = drawn(study)
    numbers = [text for text in figure.axes[0].texts if " to " not in text.get_text()]
    assert [text.get_text().endswith(" (3)") for text in numbers] == [False, True, False]
    assert numbers[0].get_fontweight() == "bold"
    note = figure.axes[-1].get_xlabel()
    assert "Bold" in note and "In brackets" in note and "Could be gained" in note
    (alone,) = (text for text in cells(drawn(make_study(PAIR, seeds=1))) if text != "+0.12")
    assert alone == "+0.16"


def test_letters_can_be_read_on_any_cell() -> None:
    assert luminance((1, 1, 1, 1)) == pytest.approx(1) and luminance((0, 0, 0, 1)) == 0
    for value in np.linspace(0, 1, 50):
        bright = luminance(mpl.colormaps["PuOr"](value))
        contrast = 1.05 / (bright + 0.05) if bright < MIDDLE_LUMINANCE else (bright + 0.05) / 0.05
        assert contrast >= 4.5
