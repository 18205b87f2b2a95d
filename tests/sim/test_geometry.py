"""Properties of angles and distances."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from ship_trl.sim.geometry import angle_off_bow, closest_approach, predicted_approach, unit_vector, wrap_angle

angles = st.floats(-50.0, 50.0)
metres = st.floats(-1000.0, 1000.0)
points = st.tuples(metres, metres)
speeds = st.floats(0.1, 40.0)


def exact(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def turned(point: Tensor, by: float) -> Tensor:
    x, y = point.tolist()
    return exact(x * math.cos(by) - y * math.sin(by), x * math.sin(by) + y * math.cos(by))


def angle_between(one: float, other: float) -> float:
    """Return the smaller absolute difference of two angles."""
    return abs(math.remainder(one - other, 2 * math.pi))


@given(angles)
def test_wrapped_angles_are_congruent_and_in_range(angle: float) -> None:
    wrapped = float(wrap_angle(exact(angle)))
    assert -math.pi <= wrapped <= math.pi
    assert angle_between(wrapped, angle) < 1e-9


def test_half_a_turn_wraps_to_its_negative() -> None:
    assert wrap_angle(exact(math.pi, -math.pi)).tolist() == [-math.pi, -math.pi]


@given(points, points)
def test_closest_approach_is_the_least_along_the_segment(
    start: tuple[float, float], end: tuple[float, float]
) -> None:
    a, b = exact(*start), exact(*end)
    least = float(closest_approach(a, b))
    assert least <= min(float(a.norm()), float(b.norm())) + 1e-9
    share = torch.linspace(0, 1, 2001, dtype=torch.float64)[:, None]
    sampled = float((a + share * (b - a)).norm(dim=-1).min())
    # Between two samples the distance changes by at most half their spacing.
    assert -1e-9 <= sampled - least <= float((b - a).norm()) / 4000 + 1e-9


def test_the_closest_approach_of_a_ship_at_rest_is_its_distance() -> None:
    still = exact(3.0, 4.0)
    assert float(closest_approach(still, still)) == 5.0


@given(points, angles, st.floats(1.0, 500.0), angles, points, angles)
def test_the_angle_off_the_bow_moves_with_the_world(
    own: tuple[float, float], heading: float, far: float, sight: float, shift: tuple[float, float], by: float
) -> None:
    position = exact(*own)
    point = position + far * unit_vector(exact(sight))[0]
    off = float(angle_off_bow(position, exact(heading)[0], point))
    assert angle_between(off, sight - heading) < 1e-6
    moved = turned(position, by) + exact(*shift), turned(point, by) + exact(*shift)
    assert angle_between(float(angle_off_bow(moved[0], exact(heading + by)[0], moved[1])), off) < 1e-6


@pytest.mark.parametrize(
    ("point", "degrees"), [((0, 9), 0), ((-9, 0), 90), ((9, 0), -90), ((-9, 9), 45), ((0, -9), -180)]
)
def test_port_is_positive(point: tuple[float, float], degrees: float) -> None:
    off = angle_off_bow(exact(0, 0), exact(math.pi / 2)[0], exact(*point))
    assert math.degrees(float(off)) == pytest.approx(degrees)


@given(angles)
def test_unit_vectors_point_along_the_heading(heading: float) -> None:
    x, y = unit_vector(exact(heading))[0].tolist()
    assert math.hypot(x, y) == pytest.approx(1.0)
    assert angle_between(math.atan2(y, x), heading) < 1e-9


@given(points, speeds, angles, st.floats(-500.0, 500.0))
def test_no_ship_comes_nearer_than_the_predicted_approach(
    offset: tuple[float, float], speed: float, course: float, time: float
) -> None:
    position, velocity = exact(*offset), speed * unit_vector(exact(course)[0])
    dcpa, tcpa = predicted_approach(position, velocity)
    assert float(dcpa) <= float((position + time * velocity).norm()) + 1e-6
    assert float((position + tcpa * velocity).norm()) == pytest.approx(float(dcpa), abs=1e-6)


def test_the_predicted_approach_of_ships_worked_out_by_hand() -> None:
    position = exact(100.0, -30.0, 40.0, -100.0, 30.0, 40.0).reshape(3, 2)
    velocity = exact(-10.0, 0.0, 0.0, 10.0, 0.0, 0.0).reshape(3, 2)
    dcpa, tcpa = predicted_approach(position, velocity)
    # One comes from ahead, one from abeam, one is at rest.
    assert dcpa.tolist() == [30.0, 40.0, 50.0] and tcpa.tolist() == [10.0, 10.0, 0.0]
    _, passed = predicted_approach(position, -velocity)
    assert passed.tolist() == [-10.0, -10.0, 0.0]
