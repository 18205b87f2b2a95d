"""Scores of the steering rules on trajectories made by hand."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from ship_trl.config.bounds import RULES
from ship_trl.policies.rules import Scores, safety_score, scaled_settings, score_rules
from ship_trl.policies.steering import Steering
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.encounter import Encounter, classify
from tests.policies.tracks import PORT, STARBOARD, STRAIGHT, track

WORLD = load_world()
SETTINGS = scaled_settings(WORLD)
IMAZU = {number: load_case(f"imazu{number:02}", WORLD) for number in (1, 2, 3, 4, 14)}


@dataclass
class Ship:
    """What an episode did about its first target ship; `rules` by their numbers."""

    encounter: Encounter
    onset: int
    manoeuvre: int
    turn: float
    safety: float
    rules: dict[int, float]


def score_all(*tracks: Tensor) -> Scores:
    last = torch.tensor([len(one) - 1 for one in tracks])
    return score_rules(pad_sequence(list(tracks), batch_first=True), last, WORLD, SETTINGS)


def score(case: Case, *held: tuple[int, int]) -> Ship:
    found = score_all(track(WORLD, case, *held))
    kind, onset, manoeuvre, turn, safety = (part[0, 0].item() for part in found[:5])
    known = dict(zip(RULES, found.rules[0, 0].tolist(), strict=True))
    rules = {rule: value for rule, value in known.items() if not math.isnan(value)}
    return Ship(Encounter(int(kind)), int(onset), int(manoeuvre), turn, safety, rules)


def test_a_collision_is_unsafe_and_not_timely() -> None:
    one = score(IMAZU[1], (STRAIGHT, 30))
    assert (one.encounter, one.onset, one.manoeuvre) == (Encounter.HEAD_ON, 0, -1)
    assert (one.safety, one.turn, one.rules) == (0, 0, {8: 0, 14: 0})


def test_head_on_wants_a_starboard_turn() -> None:
    right = score(IMAZU[1], (STARBOARD, 8), (STRAIGHT, 25))
    left = score(IMAZU[1], (PORT, 8), (STRAIGHT, 25))
    assert right.turn == pytest.approx(math.degrees(0.8), abs=0.1)
    assert left.turn == pytest.approx(-right.turn)
    # Early and apparent: Rule 8 asks for no side, Rule 14 does.
    assert right.rules[8] == pytest.approx(1.0) and left.rules[8] == pytest.approx(1.0)
    assert right.rules[14] > 0.9 and left.rules[14] < 0.3


def test_a_late_manoeuvre_scores_less() -> None:
    early = score(IMAZU[2], (STARBOARD, 8), (STRAIGHT, 25))
    late = score(IMAZU[2], (STRAIGHT, 12), (STARBOARD, 8), (STRAIGHT, 15))
    assert (early.manoeuvre, late.manoeuvre) == (0, 12)
    assert early.rules[8] == pytest.approx(1.0)
    # Stage 3 begins at 236 m; after 12 s the ships are 8 s from meeting, 170 m apart.
    assert late.rules[8] == pytest.approx(170 / 236, abs=0.01)
    assert late.rules[16] == pytest.approx(late.safety * late.rules[8])


def test_give_way_passes_astern() -> None:
    astern = score(IMAZU[2], (STARBOARD, 8), (STRAIGHT, 25))
    # To port at first, then ahead of the other ship's bow.
    ahead = score(IMAZU[2], (STRAIGHT, 1), (1, 20), (STRAIGHT, 20))
    assert astern.encounter is ahead.encounter is Encounter.GIVE_WAY
    assert set(astern.rules) == set(ahead.rules) == {8, 15, 16}
    assert astern.rules[15] == pytest.approx(astern.rules[16]) and astern.rules[15] > 0.4
    assert ahead.rules[15] == pytest.approx(max(ahead.rules[16] - 0.5, 0))


def test_stand_on_keeps_course(make_case: Callable[..., Case]) -> None:
    # Passes 50 m astern: no collision, but an encounter.
    case = make_case((-371.0, 300.0, 0.0, 15.0))
    kept = score(case, (STRAIGHT, 36))
    turned = score(case, (STARBOARD, 8), (STRAIGHT, 28))
    assert kept.encounter is turned.encounter is Encounter.STAND_ON
    assert kept.rules == {17: kept.safety} and kept.safety > 0
    assert turned.rules == {17: 0}


def test_padding_and_other_rows_do_not_matter() -> None:
    tracks = [
        track(WORLD, IMAZU[1], (STARBOARD, 8), (STRAIGHT, 25)),
        track(WORLD, IMAZU[2], (STRAIGHT, 12), (STARBOARD, 5)),
        track(WORLD, IMAZU[4], (PORT, 20)),
    ]
    together = score_all(*tracks)
    for row, one in enumerate(tracks):
        for part, alone in zip(together, score_all(one), strict=True):
            torch.testing.assert_close(part[row : row + 1], alone, equal_nan=True)


def safety(distance: float, bearing: float = 0.0, aspect: float = 0.0) -> float:
    one, other, third = torch.tensor([distance, bearing, aspect], dtype=torch.float64)
    return safety_score(one, other, third, SETTINGS).item()


@pytest.mark.parametrize(
    ("share", "expected"), [(9, 1.0), (200, 1.0), (100, 0.8), (50, 0.5), (35, 0.0), (34, 0.0), (150, 0.9)]
)
def test_range_score(share: float, expected: float) -> None:
    distance = share * WORLD.safe_distance / 35 if share > 9 else math.inf
    assert safety(distance) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("error", "speed", "action"),
    [(0.5, 15.0, 0), (-0.5, 15.0, 6), (0.04, 15.0, 3), (0.06, 15.0, 1), (0.0, 12.0, 2), (0.05, 7.5, 0)],
)
def test_steering(error: float, speed: float, action: int) -> None:
    assert Steering(WORLD)(torch.tensor([error]), torch.tensor([speed])).item() == action


def test_overtaking_may_pass_on_either_side_but_not_close_ahead() -> None:
    right = score(IMAZU[3], (STARBOARD, 4), (STRAIGHT, 10), (PORT, 4), (STRAIGHT, 30))
    left = score(IMAZU[3], (PORT, 4), (STRAIGHT, 10), (STARBOARD, 4), (STRAIGHT, 30))
    assert right.encounter is left.encounter is Encounter.OVERTAKING
    assert right.rules == pytest.approx(left.rules, abs=1e-4)
    assert set(right.rules) == {8, 13, 16} and 0 < right.rules[13] <= right.rules[16]


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
