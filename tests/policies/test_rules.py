"""Scores of the steering rules on trajectories made by hand."""

import math
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from ship_trl.policies.encounter import Steering
from ship_trl.policies.rules import Settings, ShipScore, route_ratios, safety_score, score_episode
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.dynamics import advance
from ship_trl.sim.encounter import Encounter, classify
from ship_trl.sim.state import initial_state

WORLD = load_world()
PORT, STRAIGHT, STARBOARD = 0, 3, 6
IMAZU = {number: load_case(f"imazu0{number}", WORLD) for number in (1, 2, 3)}


def track(case: Case, *held: tuple[int, int]) -> Tensor:
    """Return the states of (action, steps) held one after the other."""
    states = [initial_state(case, WORLD)]
    actions = torch.tensor(WORLD.actions)
    for action, steps in held:
        for _ in range(steps):
            states.append(advance(states[-1], torch.tensor(action), actions, WORLD.dt))
    return torch.stack(states)


def score(case: Case, *held: tuple[int, int]) -> ShipScore:
    return score_episode(track(case, *held))[0]


def test_a_collision_is_unsafe_and_not_timely() -> None:
    one = score(IMAZU[1], (STRAIGHT, 30))
    assert (one.encounter, one.onset, one.manoeuvre) == (Encounter.HEAD_ON, 0, -1)
    assert one.least_distance == pytest.approx(0.0, abs=1e-3)
    assert (one.safety, one.rule8, one.score, one.turn) == (0, 0, 0, 0)
    assert math.isnan(one.dcpa)


def test_head_on_wants_a_starboard_turn() -> None:
    right = score(IMAZU[1], (STARBOARD, 8), (STRAIGHT, 25))
    left = score(IMAZU[1], (PORT, 8), (STRAIGHT, 25))
    assert right.turn == pytest.approx(math.degrees(0.8), abs=0.1)
    assert left.turn == pytest.approx(-right.turn)
    assert right.least_distance == pytest.approx(left.least_distance, abs=0.01)
    # Early and apparent: Rule 8 asks for no side, Rule 14 does.
    assert right.rule8 == pytest.approx(1.0) and left.rule8 == pytest.approx(1.0)
    assert right.score > 0.9 and left.score < 0.3


def test_a_late_manoeuvre_scores_less() -> None:
    early = score(IMAZU[2], (STARBOARD, 8), (STRAIGHT, 25))
    late = score(IMAZU[2], (STRAIGHT, 12), (STARBOARD, 8), (STRAIGHT, 15))
    assert (early.manoeuvre, late.manoeuvre) == (0, 12)
    assert early.dcpa == pytest.approx(0.0, abs=1e-3) and late.tcpa == pytest.approx(8.0, abs=1e-3)
    assert early.rule8 == pytest.approx(1.0)
    # Stage 3 begins at 236 m; after 12 s the ships are 8 s from meeting, 170 m apart.
    assert late.rule8 == pytest.approx(170 / 236, abs=0.01)


def test_a_small_turn_is_not_apparent() -> None:
    # Five steps of 0.01 rad are 2.9 degrees, and slow from 15 to 12 m/s.
    one = score(IMAZU[2], (4, 5), (STRAIGHT, 25))
    assert one.turn == pytest.approx(math.degrees(0.05), abs=0.01)
    slowed = ((0.2 - 0.07) / 0.18) ** 2
    assert one.rule8 == pytest.approx((((one.turn - 2) / 28) ** 2 + slowed) / 2, abs=0.01)


def test_give_way_passes_astern() -> None:
    astern = score(IMAZU[2], (STARBOARD, 8), (STRAIGHT, 25))
    # To port at first, then ahead of the other ship's bow.
    ahead = score(IMAZU[2], (STRAIGHT, 1), (1, 20), (STRAIGHT, 20))
    assert astern.encounter is ahead.encounter is Encounter.GIVE_WAY
    assert astern.score == pytest.approx(astern.safety * astern.rule8)
    assert astern.score > 0.4 > ahead.score


def test_stand_on_keeps_course(make_case: Callable[..., Case]) -> None:
    # Passes 50 m astern: no collision, but an encounter.
    case = make_case((-371.0, 300.0, 0.0, 15.0))
    kept = score(case, (STRAIGHT, 36))
    turned = score(case, (STARBOARD, 8), (STRAIGHT, 28))
    assert kept.encounter is turned.encounter is Encounter.STAND_ON
    assert math.isnan(kept.rule8)
    assert kept.score == kept.safety > 0
    assert turned.score == 0


def test_overtaking_may_pass_on_either_side() -> None:
    right = score(IMAZU[3], (STARBOARD, 4), (STRAIGHT, 10), (PORT, 4), (STRAIGHT, 30))
    left = score(IMAZU[3], (PORT, 4), (STRAIGHT, 10), (STARBOARD, 4), (STRAIGHT, 30))
    assert right.encounter is left.encounter is Encounter.OVERTAKING
    assert right.score == pytest.approx(left.score, abs=1e-4) and right.score > 0


def test_a_ship_that_never_comes_near_is_no_encounter(make_case: Callable[..., Case]) -> None:
    one = score(make_case((-400.0, 0.0, 180.0, 15.0)), (STRAIGHT, 36))
    assert (one.encounter, one.onset, one.safety) == (Encounter.NONE, -1, 1.0)
    assert math.isnan(one.score) and one.least_distance == pytest.approx(400.0)
    assert score_episode(track(make_case(), (STRAIGHT, 5))) == []


@pytest.mark.parametrize(
    ("distance", "expected"),
    [(300, 1.0), (257, 1.0), (129, 0.8), (64, 0.5), (45, 0.0), (44, 0.0), (193, 0.9)],
)
def test_range_score(distance: float, expected: float) -> None:
    assert safety_score(distance, 0.0, 0.0) == pytest.approx(expected)


def test_pose_makes_a_near_pass_safer() -> None:
    # Bow to bow counts nothing; a ship abeam that sees own ship abeam counts in full.
    assert safety_score(64, math.pi / 2, math.pi / 2) == pytest.approx(1.0)
    assert safety_score(64, 0.0, math.pi / 2) == pytest.approx(0.5 + 0.5 * 0.25)
    assert safety_score(44, math.pi / 2, math.pi / 2, Settings()) == 0.0


def test_route_ratios(make_case: Callable[..., Case]) -> None:
    case = make_case()
    assert route_ratios(track(case, (STRAIGHT, 36)), WORLD) == pytest.approx((1.0, 1.0))
    # Ten steps of weaving go half as far, and turn back to the course.
    way, time = route_ratios(track(case, *[(PORT, 1), (STARBOARD, 1)] * 5, (STRAIGHT, 31)), WORLD)
    assert way == pytest.approx(1.0) and time == pytest.approx(41 / 36)


@pytest.mark.parametrize(
    ("bearing", "aspect", "expected"),
    [
        (4, -4, Encounter.HEAD_ON),
        (6, -6, Encounter.GIVE_WAY),
        (-6, 6, Encounter.STAND_ON),
        (112, -50, Encounter.GIVE_WAY),
        (0, 180, Encounter.OVERTAKING),
        (180, 0, Encounter.OVERTAKEN),
        (-113, 60, Encounter.OVERTAKEN),
        (90, 90, Encounter.NONE),
    ],
)
def test_sectors(bearing: float, aspect: float, expected: Encounter) -> None:
    angles = torch.deg2rad(torch.tensor([float(bearing), float(aspect)]))
    assert classify(angles[:1], angles[1:], math.radians(5)).item() == expected


def test_a_wider_head_on_sector_is_a_setting() -> None:
    angles = torch.deg2rad(torch.tensor([10.0]))
    assert classify(angles, -angles, math.radians(13)).item() == Encounter.HEAD_ON


@pytest.mark.parametrize(
    ("error", "speed", "action"),
    [(0.5, 15.0, 0), (-0.5, 15.0, 6), (0.04, 15.0, 3), (0.06, 15.0, 1), (0.0, 12.0, 2), (0.05, 7.5, 0)],
)
def test_steering(error: float, speed: float, action: int) -> None:
    assert Steering(WORLD)(torch.tensor([error]), torch.tensor([speed])).item() == action
