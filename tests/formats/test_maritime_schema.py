"""Traffic situations, as the schema, trafficgen and the old package have them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.bounds import KNOT
from ship_trl.config.errors import ConfigError
from ship_trl.formats.maritime_schema import read_situation, write_situation
from ship_trl.formats.situation import Plane, Ship, Situation


def ship(latitude: float, longitude: float, **initial: float) -> dict[str, Any]:
    return {"static": {"id": 1}, "initial": {"position": {"lat": latitude, "lon": longitude}, **initial}}


def situation(own: dict[str, Any], *targets: dict[str, Any]) -> dict[str, Any]:
    return {"version": "0.2.0", "ownShip": own, "targetShips": list(targets)}


def path(*points: tuple[float, float], **legs: Any) -> dict[str, Any]:
    waypoints: list[dict[str, Any]] = [{"position": {"lat": lat, "lon": lon}} for lat, lon in points]
    waypoints[1] |= legs
    return {"static": {"id": 1}, "waypoints": waypoints}


def test_a_ship_begins_where_initial_says() -> None:
    found = read_situation(situation(ship(56, 11, sog=10, cog=30), ship(56.01, 11, sog=12, cog=360)), "one")
    assert (found.own.x, found.own.y, found.own.course) == (0, 0, 30)
    assert found.own.speed == pytest.approx(10 * KNOT)
    (target,) = found.targets
    assert (target.x, target.y) == pytest.approx((0, 1113.4), abs=0.5)
    assert target.course == 0 and found.goal is None and found.start is None


def test_without_course_and_speed_the_first_leg_says_them() -> None:
    # As trafficgen writes: no sog and cog in `initial`, the goal as the last waypoint.
    own = path((56, 11), (56, 11.1), leg={"sog": 8.0}) | {"initial": {"heading": 45.0}}
    found = read_situation(situation(own), "one")
    assert found.own.course == pytest.approx(90) and found.own.speed == pytest.approx(8 * KNOT)
    assert found.goal == pytest.approx((6239.6, 0), abs=1)


def test_the_speed_of_a_legs_data_counts_before_its_own() -> None:
    own = path((56, 11), (56.1, 11), leg={"sog": 8.0, "data": {"sog": {"value": 10.0}}})
    assert read_situation(situation(own), "one").own.speed == pytest.approx(10 * KNOT)


def test_the_old_packages_spelling_of_positions_is_read() -> None:
    own = ship(0, 0, sog=10, cog=0)
    own["initial"]["position"] = {"latitude": 56.0, "longitude": 11.0}
    found = read_situation({"ownShip": own, "targetShips": [ship(56.01, 11, sog=1, cog=1)]}, "one")
    assert found.origin == Plane(56, 11) and found.targets[0].y == pytest.approx(1113.4, abs=0.5)


def test_a_target_ship_that_turns_is_noted_and_one_that_does_not_is_not() -> None:
    own = ship(56, 11, sog=10, cog=0)
    straight = path((56.01, 11), (56.02, 11), (56.04, 11), leg={"sog": 5})
    turning = path((56.01, 11), (56.02, 11), (56.02, 11.1), leg={"sog": 5})
    notes = read_situation(situation(own, straight, turning), "one").notes
    assert notes == ("a target ship turns at a waypoint; it keeps its first course",)


@pytest.mark.parametrize(
    ("own", "message"),
    [
        ({"initial": {"sog": 1, "cog": 1}}, "ownShip.initial.position.lat: missing; a value is needed"),
        (
            ship(91, 11, sog=1, cog=1),
            "ownShip.initial.position.lat: must be less than or equal to 85, got 91",
        ),
        (
            ship(56, 181, sog=1, cog=1),
            "ownShip.initial.position.lon: must be less than or equal to 180, got 181",
        ),
        (ship(56, 11, cog=1), "ownShip.initial.sog: missing; a value is needed"),
        (ship(56, 11, sog=1), "ownShip: has no course"),
        (ship(56, 11, sog=0, cog=1), "own ship is at rest"),
        (ship(56, 11, sog=103, cog=1), "ownShip.initial.sog: must be less than or equal to 102.2, got 103"),
        (ship(56, 11, sog=math.nan, cog=1), "ownShip.initial.sog: must be a finite number, got NaN"),
        (ship(56, 11, sog=True, cog=1), "ownShip.initial.sog: must be a valid number, got true"),
        (ship(56, 11, sog=1, cog=361), "ownShip.initial.cog: must be less than or equal to 360, got 361"),
        (path((56, 11), (56, 11), leg={"sog": 1}), "ownShip.waypoints[1]: is the same place as waypoints[0]"),
        (ship(56, 11, sog=1, cog=1) | {"waypoints": 3}, "ownShip.waypoints: must be a valid array, got 3"),
        (7, "ownShip: must be a group of keys, got 7"),
    ],
)
def test_a_wrong_ship_is_refused_by_its_key(own: Any, message: str) -> None:
    with pytest.raises((ValueError, ConfigError), match=re.escape(message)):
        read_situation(situation(own), "one")


@given(
    st.lists(
        st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0, 359.9), st.floats(0.1, 15)),
        min_size=1,
        max_size=4,
    ),
    st.floats(-70, 70),
    st.floats(-180, 180),
)
@settings(max_examples=60)
def test_what_is_written_is_read_again(
    ships: list[tuple[float, float, float, float]], latitude: float, longitude: float
) -> None:
    own, *targets = (Ship(*ship) for ship in ships)
    own = Ship(0.0, 0.0, own.course, own.speed)
    given = Situation("a", own, None, tuple(targets), Plane(latitude, longitude))
    found = read_situation(json.loads(write_situation(given)), "a")
    for one, other in zip((own, *targets), (found.own, *found.targets), strict=True):
        assert math.dist((one.x, one.y), (other.x, other.y)) < 1
        assert abs((one.course - other.course + 180) % 360 - 180) < 0.1
        assert abs(one.speed - other.speed) < 0.05 * KNOT


def test_a_null_is_a_key_that_is_not_there() -> None:
    own = path((56, 11), (56, 11.1), leg={"sog": 8.0, "data": None})
    own["initial"] = {"position": None, "sog": None, "cog": None}
    found = read_situation(situation(own) | {"startTime": None}, "one")
    assert (found.own.course, found.own.speed) == pytest.approx((90, 8 * KNOT), abs=0.1)


@given(st.lists(st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(0, 359)), max_size=3))
@settings(max_examples=25)
def test_a_mirrored_file_is_a_mirrored_situation(ships: list[tuple[float, float, float]]) -> None:
    plane = Plane(56, 11)

    def read(side: int) -> tuple[Ship, ...]:
        targets = [
            ship(*plane.to_degrees(side * x, y), sog=9, cog=(side * course) % 360) for x, y, course in ships
        ]
        return read_situation(situation(ship(56, 11, sog=10, cog=0), *targets), "a").targets

    for right, left in zip(read(1), read(-1), strict=True):
        assert (right.x, right.y) == pytest.approx((-left.x, left.y), abs=0.01)
        assert (right.course + left.course) % 360 == pytest.approx(0, abs=1e-9)


def test_trafficgen_reads_what_is_written(tmp_path: Path) -> None:
    reader = pytest.importorskip("trafficgen.read_files", reason="trafficgen is not installed")
    track = np.array([[0.0, 0, 0], [30, 0, 150], [60, 30, 300]])
    given = Situation("a", Ship(0, 0, 0, 5, track), (0, 300), (Ship(500, 900, 270, 5),), Plane(56, 11))
    (tmp_path / "a.json").write_text(write_situation(given))
    (found,) = reader.read_generated_situation_files(tmp_path)
    assert found.own_ship.initial.cog == 0 and len(found.own_ship.waypoints) == 3
    assert len(found.target_ships) == 1


def test_what_trafficgen_writes_is_read(tmp_path: Path) -> None:
    generator = pytest.importorskip("trafficgen.ship_traffic_generator", reason="trafficgen is not installed")
    writer = pytest.importorskip("trafficgen.write_traffic_situation_to_file")
    static = {"id": 1, "dimensions": {"length": 150.0, "width": 25.0}, "shipType": "Cargo", "sogMax": 20.0}
    initial = {"position": {"lat": 56.0, "lon": 11.0}, "sog": 10.0, "cog": 90.0, "heading": 90.0}
    encounter = {
        "desiredEncounterType": "crossing-give-way",
        "beta": 30.0,
        "relativeSpeed": 1.0,
        "vectorTime": 12.0,
    }
    asked = {"title": "a", "description": "b", "ownShip": {"initial": initial}, "encounters": [encounter]}
    for name in ("situations", "targets", "out"):
        (tmp_path / name).mkdir()
    (tmp_path / "situations/one.json").write_text(json.dumps(asked | {"numSituations": 1}))
    (tmp_path / "targets/one.json").write_text(json.dumps(static))
    (tmp_path / "own.json").write_text(json.dumps(static))
    settings_file = Path(generator.__file__).parent / "settings/encounter_settings.json"
    made = generator.generate_traffic_situations(
        situations_data=tmp_path / "situations",
        own_ship_data=tmp_path / "own.json",
        target_ships_data=tmp_path / "targets",
        settings_data=settings_file,
    )
    writer.write_traffic_situations_to_json_file(made, write_folder=tmp_path / "out")
    (file,) = (tmp_path / "out").glob("*.json")
    found = read_situation(json.loads(file.read_text()), "a")
    assert found.own.course == pytest.approx(90, abs=0.1) and found.own.speed == pytest.approx(10 * KNOT)
    # 30 degrees to starboard of a ship that heads east.
    (target,) = found.targets
    assert math.degrees(math.atan2(-target.y, target.x)) == pytest.approx(30, abs=0.5)
