"""Equation 8 by its four rules, equation 7 as a distance."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.config.types import World
from ship_trl.sim.cases import Case, TargetShip, case_names, load_case
from ship_trl.transfer.similarity import compare, distance, similarity

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


def shipped(world: World) -> dict[str, Case]:
    return {name: load_case(name, world) for name in case_names()}


@pytest.mark.parametrize(("base", "target", "value"), [("1", "2", 0.83), ("3", "4", 0.45), ("5", "6", 0.42)])
def test_table_2(world: World, base: str, target: str, value: float) -> None:
    found = shipped(world)
    assert round(similarity(found[base], found[target]), 2) == value


def test_each_rule_adds_what_section_4_1_says(world: World) -> None:
    found = shipped(world)
    steps = {(r.attribute, r.common, r.different) for r in compare(found["3"], found["4"])}
    assert steps == {("ideal path", 0, 1), ("common target ship", 0.5, 0), ("extra target ship", 0, 0.2)}
    steps = {(r.attribute, r.common, r.different) for r in compare(found["1"], found["2"])}
    assert steps == {("ideal path", 1, 0), ("extra target ship", 0, 0.4)}


def test_case_2_is_the_best_source_for_the_new_case(world: World) -> None:
    found = shipped(world)
    values = {name: similarity(found[name], found["new"]) for name in "123456"}
    assert max(values, key=lambda name: values[name]) == "2"


@given(a=cases, b=cases)
def test_similarity_is_a_share_and_the_same_both_ways(a: Case, b: Case) -> None:
    assert 0.0 <= similarity(a, b) <= 1.0
    assert similarity(a, b) == pytest.approx(similarity(b, a))
    assert similarity(a, a) == 1.0


@given(a=cases, extra=ships)
def test_an_extra_ship_makes_less_alike(a: Case, extra: TargetShip) -> None:
    more = dataclasses.replace(a, target_ships=[*a.target_ships, extra])
    assert similarity(a, more) < 1.0


@given(a=cases, b=cases, c=cases)
def test_distance_is_a_metric(a: Case, b: Case, c: Case) -> None:
    from tests.conftest import paper_world

    world = paper_world()
    assert distance(a, a, world) == 0.0
    assert distance(a, b, world) == pytest.approx(distance(b, a, world))
    assert distance(a, c, world) <= distance(a, b, world) + distance(b, c, world) + 1e-9


def test_weights_of_equation_7_count(world: World) -> None:
    found = shipped(world)
    names = (
        "target ships",
        "goal distance",
        "danger",
        "tcpa",
        "relative course east",
        "relative course north",
    )
    only = dict.fromkeys(names, 0.0) | {"target ships": 16.0}
    assert distance(found["1"], found["4"], world, only) == pytest.approx(2.0)


def test_headings_are_compared_round_the_circle(world: World) -> None:
    case = load_case("3", world)
    ship = case.target_ships[0]
    turned = dataclasses.replace(case, target_ships=[dataclasses.replace(ship, heading=ship.heading - 360)])
    assert similarity(case, turned) == 1.0
