"""What the heat map compares with what."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from ship_trl.study.analysis.contrasts import gain
from ship_trl.study.report.heat_map import (
    ARMS,
    draw_gains,
    draw_greedy_gains,
    gains,
    luminance,
    reused,
    rows,
)

from ship_trl.study.report.figures import PAGE, TELEPHONE, Form
from tests.study.synthetic import BEST, RANDOM, make_study


def test_a_case_to_itself_may_be_a_pair_like_others() -> None:
    study = make_study({("pairs", "self", "scratch"): 0.5, ("pairs", "self", "FE1"): 0.7}, seeds=2)
    for key, record in study.records.items():
        study.records[key] = replace(record, source="2")
    ((name, (scratch, arms)),) = rows(study).items()
    found = gain(study, arms["FE1"], scratch)
    assert name == "2 to 2" and found and found.value > 0.1


def test_as_a_control_it_is_compared_with_the_pair_that_has_its_target() -> None:
    ends = {("pairs", "high", "scratch"): 0.5, ("controls", "self", "FE1"): 0.7}
    found = rows(make_study(ends, seeds=2))
    scratch, arms = found["2 to 2"]
    assert scratch == ("pairs", "high", "scratch") and arms["FE1"] == ("controls", "self", "FE1")


def test_every_control_has_its_row_and_arm() -> None:
    places = {("controls", label, "FTW"): 0.8 for label in ("self", "self4", "self6", "ship")}
    places |= {("pairs", pair, "scratch"): 0.5 for pair in ("high", "low", "lowest")}
    places |= {("controls", "high", arm): 0.6 for arm in ("FE3-random", "FE3-permuted")}
    study = make_study(places, seeds=2)
    found = rows(study)
    for name in ("2 to 2", "4 to 4", "6 to 6", "ship to 2"):
        scratch, arms = found[name]
        measured = gain(study, arms["FTW"], scratch)
        assert measured and measured.value > 0.1
    assert {"FE3-random", "FE3-permuted"} <= set(ARMS)


REUSED = {
    ("reuse/epsilon_low", "new", "scratch"): 0.5,
    ("reuse/epsilon_low", "2-new", "FTW"): 0.8,
    ("reuse/alone", "2-new", "FTW"): 0.7,
}


def test_reuse_lies_apart_and_no_row_is_blank() -> None:
    places = {("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7, **REUSED}
    # Of this pair arm and scratch have no seed in common.
    study = make_study({**places, ("pairs", "low", "scratch"): 0.5, ("pairs", "low", "FE1"): 0.6}, seeds=3)
    for key in list(study.records):
        if key[1] == "low" and (key[2] == "scratch") == (key[3] == 0):
            del study.records[key]
    sources = {"high": "8", "low": "9"}
    records = {k: replace(r, source=sources.get(k[1])) for k, r in study.records.items()}
    study = replace(study, records=records)
    table = gains(study)
    assert list(table) == ["8 to 2"] and list(table["8 to 2"]) == ["FE1"]
    assert list(reused(study)) == ["reused, \N{GREEK SMALL LETTER EPSILON} 0.1", "case 2"]


@pytest.mark.parametrize("form", [PAGE, TELEPHONE])
def test_a_cell_says_how_sure_its_number_is(form: Form) -> None:
    study = make_study({("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7, **REUSED}, seeds=6)
    figure = draw_gains(study, form)
    assert figure is not None
    cells = [text.get_text() for axis in figure.axes for text in axis.texts]
    found = gain(study, ("pairs", "high", "FE1"), ("pairs", "high", "scratch"))
    assert found and found.low < found.value < found.high
    assert f"{found.value:+.2f}" in cells and f"{found.low:+.2f} to {found.high:+.2f}" in cells
    # Three cells of a number and its interval, in two maps, and a scale.
    assert len(cells) == 6 and len(figure.axes) == 3


def test_a_cell_of_fewer_seeds_than_others_says_so() -> None:
    places = {("pairs", "high", arm): end for arm, end in (("scratch", 0.5), ("FE1", 0.7), ("FE2", 0.7))}
    study = make_study(places, seeds=6)
    for key in list(study.records):
        if key[2] == "FE2" and key[3] > 2:
            del study.records[key]
    figure = draw_gains(study, PAGE)
    assert figure is not None
    shown = [text.get_text() for text in figure.axes[0].texts]
    assert [text.endswith(" (3)") for text in shown if " to " not in text] == [False, True]


def test_a_map_says_of_which_returns_it_is() -> None:
    study = make_study({("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7}, seeds=2)
    titles = [
        " ".join(text.get_text() for text in figure.texts)
        for figure in (draw_gains(study, PAGE), draw_greedy_gains(study, PAGE))
        if figure is not None
    ]
    assert "training returns" in titles[0] and "greedy returns" in titles[1]


def test_greedy_gains_are_of_evaluations_alone() -> None:
    study = make_study({("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7}, seeds=6)
    for key, record in study.records.items():
        if key[2] == "FE1":
            # Evaluations are 0.3 of a score worse than what was earned while it was learned.
            known = replace(record.greedy, returns=record.greedy.returns - 0.3 * (BEST - RANDOM))
            study.records[key] = replace(record, greedy=known)
    trained, greedy = (draw(study, PAGE) for draw in (draw_gains, draw_greedy_gains))
    assert trained is not None and greedy is not None
    first = [float(figure.axes[0].texts[0].get_text()) for figure in (trained, greedy)]
    assert first[0] == 0.16 and first[1] == pytest.approx(first[0] - 0.3, abs=0.02)


def test_a_single_seed_has_no_interval() -> None:
    study = make_study({("pairs", "high", "scratch"): 0.5, ("pairs", "high", "FE1"): 0.7}, seeds=1)
    figure = draw_gains(study, PAGE)
    assert figure is not None and [text.get_text() for text in figure.axes[0].texts] == ["+0.16"]


def test_letters_can_be_read_on_any_cell() -> None:
    assert luminance((1, 1, 1, 1)) == pytest.approx(1) and luminance((0, 0, 0, 1)) == 0
    for value in np.linspace(0, 1, 50):
        bright = luminance(mpl.colormaps["PuOr"](value))
        contrast = 1.05 / (bright + 0.05) if bright < 0.18 else (bright + 0.05) / 0.05
        assert contrast >= 4.5
