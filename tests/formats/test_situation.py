"""The plane that touches the earth."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.formats.situation import Plane, course_to, metres_per_degree


def test_degrees_have_the_lengths_of_the_ellipsoid() -> None:
    # WGS84: a degree of longitude and of latitude at the equator and at 55 degrees north.
    assert metres_per_degree(0.0) == pytest.approx((111_319.49, 110_574.28), abs=0.1)
    assert metres_per_degree(55.0) == pytest.approx((63_994.1, 111_325.0), abs=2)


@given(st.floats(-80, 80), st.floats(-180, 180), st.floats(-2e4, 2e4), st.floats(-2e4, 2e4))
def test_places_return_from_degrees(latitude: float, longitude: float, x: float, y: float) -> None:
    plane = Plane(latitude, longitude)
    assert plane.to_metres(*plane.to_degrees(x, y)) == pytest.approx((x, y), abs=1e-3)


@pytest.mark.parametrize(("x", "y", "course"), [(0, 1, 0), (1, 0, 90), (0, -1, 180), (-1, 0, 270)])
def test_courses_count_clockwise_from_north(x: float, y: float, course: float) -> None:
    assert course_to(x, y) == pytest.approx(course)
