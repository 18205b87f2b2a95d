"""What is written for other tools is read again."""

from __future__ import annotations

import io
import json
import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ship_trl.config.bounds import KNOT
from ship_trl.formats.ais import sort_fixes, table_parts, write_ais
from ship_trl.formats.maritime_schema import read_situation, write_situation
from ship_trl.formats.situation import Plane, Ship, Situation

SHIPS = st.lists(
    st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0, 359.9), st.floats(0.5, 25)),
    min_size=1,
    max_size=4,
)
START = datetime(2025, 6, 1, 12, tzinfo=UTC)


def straight(x: float, y: float, course: float, knots: float) -> Ship:
    """A ship that keeps its course for five minutes, in steps of 30 s."""
    seconds, angle, speed = np.arange(0, 301, 30.0), math.radians(course), knots * KNOT
    way = seconds * speed
    return Ship(
        x, y, course, speed, np.stack((seconds, x + way * math.sin(angle), y + way * math.cos(angle)), -1)
    )


@given(SHIPS, st.floats(-70, 70), st.floats(-180, 179.9))
@settings(max_examples=25)
def test_a_scene_is_the_same_in_both_forms(
    ships: list[tuple[float, float, float, float]], latitude: float, longitude: float
) -> None:
    plane, (own, *targets) = Plane(latitude, longitude), [straight(*ship) for ship in ships]
    own = straight(0, 0, own.course, own.speed / KNOT)
    given = Situation("a", own, None, tuple(targets), plane, START)
    found = read_situation(json.loads(write_situation(given)), "a")
    assert found.start == START
    fixes = sort_fixes(table_parts(io.BytesIO(write_ais(given).encode()), Path("a.csv")))
    for number, (one, other) in enumerate(zip((own, *targets), (found.own, *found.targets), strict=True)):
        rows = fixes.ship == number
        assert fixes.time[rows].tolist() == [START.timestamp() + second for second in range(0, 301, 10)]
        x, y = plane.to_metres(fixes.latitude[rows], fixes.longitude[rows])
        assert one.track is not None
        for axis, places in ((1, x), (2, y)):
            wanted = np.interp(np.arange(0, 301, 10), one.track[:, 0], one.track[:, axis])
            np.testing.assert_allclose(places, wanted, rtol=0, atol=1)
        assert math.dist((one.x, one.y), (other.x, other.y)) < 1
        for course in (other.course, *fixes.course[rows]):
            assert abs(math.remainder(one.course - course, 360)) < 0.1
        for speed in (other.speed, *fixes.speed[rows]):
            assert abs(one.speed - speed) < 0.0501 * KNOT
