"""The maps of a report: where ships begin, and no map of another case."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.report.encounters import draw_cases

CASE = load_case("4", load_world())


def study_of(cases: dict[str, str]) -> Any:
    return SimpleNamespace(plan=SimpleNamespace(cases=cases))


def test_each_case_is_drawn_where_its_ships_begin() -> None:
    figure = draw_cases(study_of({"4": CASE.fingerprint, "3": load_case("3", load_world()).fingerprint}))
    assert figure is not None
    axis, other = figure.axes
    assert [axis.get_title(), other.get_title()] == ["case 4", "case 3"]
    places = [np.asarray(line.get_xydata()) for line in axis.lines]
    begin = {tuple(map(float, place[0])) for place in places if len(place) == 1}
    assert begin == {(0.0, 0.0), *((ship.x, ship.y) for ship in CASE.target_ships)}


def test_a_case_that_has_changed_or_is_not_here_has_no_map() -> None:
    changed = replace(CASE, heading=80.0).fingerprint
    assert draw_cases(study_of({"4": changed, "nowhere": CASE.fingerprint})) is None
