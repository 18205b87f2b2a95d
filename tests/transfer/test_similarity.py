"""Equation 8 by its four rules, equation 7 as a distance."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.config.paths import conf_files
from ship_trl.sim.cases import Case, TargetShip, load_case, load_world
from ship_trl.transfer.similarity import distance, similarity

WORLD = load_world()
BUNDLED = {name: load_case(name, WORLD) for name in sorted(conf_files("case"))}
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
