"""Equation 8 by its four rules, equation 7 as a distance."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.sim.cases import Case, TargetShip, case_names, load_case, load_world
from ship_trl.transfer.similarity import MEASURES, characteristics, compare, distance, similarity

WORLD = load_world()
BUNDLED = {name: load_case(name, WORLD) for name in case_names()}
ships = st.builds(
    TargetShip,
    x=st.sampled_from([-300.0, 300.0]),
    y=st.sampled_from([100.0, 500.0]),
    heading=st.sampled_from([0.0, 90.0, 210.0]),
    speed=st.sampled_from([10.0, 15.0]),
)
cases = st.builds(
    Case,
    start=st.just([0.0, 0.0]),
    heading=st.just(90.0),
    goal=st.just([0.0, 600.0]),
    ideal_path=st.sampled_from(["straight", "port"]),
    target_ships=st.lists(ships, max_size=3),
)


@pytest.mark.parametrize(("base", "target", "value"), [("1", "2", 0.83), ("3", "4", 0.45), ("5", "6", 0.42)])
def test_table_2(base: str, target: str, value: float) -> None:
    assert round(similarity(BUNDLED[base], BUNDLED[target]), 2) == value


def test_comparisons_have_the_weights_of_section_4_1() -> None:
    weights = {(one.attribute, one.common, one.different) for one in compare(BUNDLED["3"], BUNDLED["4"])}
    assert weights == {("ideal path", 0, 1), ("common target ship", 0.5, 0), ("extra target ship", 0, 0.2)}
    weights = {(one.attribute, one.common, one.different) for one in compare(BUNDLED["1"], BUNDLED["2"])}
    assert weights == {("ideal path", 1, 0), ("extra target ship", 0, 0.4)}


def test_case_2_is_the_best_source_for_the_new_case() -> None:
    values = {name: similarity(BUNDLED[name], BUNDLED["new"]) for name in "123456"}
    assert max(values, key=lambda name: values[name]) == "2"


@pytest.mark.parametrize(
    ("base", "target", "alike"),
    [("3", "4", True), ("5", "6", True), ("3", "5", False), ("1", "2", True), ("1", "3", False)],
)
def test_the_side_of_the_ideal_path(base: str, target: str, alike: bool) -> None:
    assert MEASURES["side"].value(BUNDLED[base], BUNDLED[target], WORLD) == float(alike)


@given(a=cases, b=cases)
def test_similarity_is_a_share_and_the_same_both_ways(a: Case, b: Case) -> None:
    assert 0.0 <= similarity(a, b) <= 1.0
    assert similarity(a, b) == pytest.approx(similarity(b, a))
    assert similarity(a, a) == 1.0


@given(a=cases, extra=ships)
def test_an_extra_ship_lowers_the_similarity(a: Case, extra: TargetShip) -> None:
    more = dataclasses.replace(a, target_ships=[*a.target_ships, extra])
    assert similarity(a, more) < 1.0


@given(a=cases, b=cases, c=cases)
def test_distance_is_a_metric(a: Case, b: Case, c: Case) -> None:
    assert distance(a, a, WORLD) == 0.0
    assert distance(a, b, WORLD) == pytest.approx(distance(b, a, WORLD))
    assert distance(a, c, WORLD) <= distance(a, b, WORLD) + distance(b, c, WORLD) + 1e-9


def test_equation_7_uses_its_weights() -> None:
    weights = dict.fromkeys(characteristics(BUNDLED["1"], WORLD), 0.0) | {"target ships": 16.0}
    assert distance(BUNDLED["1"], BUNDLED["4"], WORLD, weights) == pytest.approx(2.0)


def test_headings_are_compared_modulo_360_degrees() -> None:
    case = BUNDLED["3"]
    ship = case.target_ships[0]
    turned = dataclasses.replace(case, target_ships=[dataclasses.replace(ship, heading=ship.heading - 360)])
    assert similarity(case, turned) == 1.0
