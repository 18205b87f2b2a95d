"""Metrics of episodes, and scores of the steering rules, on trajectories made by hand."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from ship_trl.config.bounds import RULES
from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.policies.metrics import Measurements, measure_episodes, safety_score, score_rules
from ship_trl.policies.steering import Steering
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.encounter import Encounter, classify
from ship_trl.sim.state import initial_state
from ship_trl.sim.transition import Transition, advance

WORLD = load_world()
PORT, STRAIGHT, STARBOARD = 0, 3, 6


def track(world: World, case: Case, *held: tuple[int, int]) -> Tensor:
    """Return the states [T + 1, S] of (action, steps) held one after the other."""
    states = [initial_state(case, world)]
    actions = torch.tensor(world.actions)
    for action, steps in held:
        for _ in range(steps):
            states.append(advance(states[-1], torch.tensor(action), actions, world.dt))
    return torch.stack(states)


def episode(world: World, states: Tensor, actions: list[int]) -> Episode:
    """Return the episode of a track; it may go on after a collision."""
    after = Transition(world)(states[:-1], torch.tensor(actions))
    collision = bool(after.collision.any())
    return Episode(
        states,
        torch.tensor(actions),
        None,
        after.reward,
        goal=bool(after.goal[-1]) and not collision,
        collision=collision,
        dcpa=float(after.min_distance.min()),
    )


def measure(case: Case, *held: tuple[int, int], head_on: float = 5.0) -> Measurements:
    actions = [action for action, steps in held for _ in range(steps)]
    return measure_episodes([episode(WORLD, track(WORLD, case, *held), actions)], WORLD, head_on)


def number(found: Measurements, name: str) -> float:
    return found.of_episode(0)[name]


def test_the_straight_way_has_ratio_one(make_case: Callable[..., Case]) -> None:
    found = measure(make_case(), (STRAIGHT, 36))
    assert found.outcomes[0] == "goal" and found.encounters[0] == "none"
    assert (number(found, "path_ratio"), number(found, "time_ratio")) == pytest.approx((1.0, 1.0))
    assert number(found, "return") == pytest.approx(83.9, abs=0.01) and number(found, "steps") == 36
    others = {"return", "steps", "path_ratio", "time_ratio"}
    assert all(math.isnan(number(found, name)) for name in found.values if name not in others)


def test_dcpa_and_tcpa_are_those_of_the_manoeuvre() -> None:
    case = load_case("imazu02", WORLD)
    late = measure(case, (STRAIGHT, 12), (STARBOARD, 8), (STRAIGHT, 15))
    assert number(late, "dcpa") == pytest.approx(0.0, abs=1e-3)
    assert number(late, "tcpa") == pytest.approx(8.0, abs=1e-3)
    slower = measure(case, (STRAIGHT, 5), (PORT, 1), (STARBOARD, 1), (STRAIGHT, 5))
    assert number(slower, "tcpa") == pytest.approx(15.0, abs=1e-3)
    corrected = measure(case, (PORT, 1), (STRAIGHT, 11), (STARBOARD, 8), (STRAIGHT, 15))
    assert 7 < number(corrected, "tcpa") < 10 and number(corrected, "dcpa") > 5
    kept = measure(case, (STRAIGHT, 18))
    assert kept.outcomes[0] == "collision" and number(kept, "least_distance") < 45
    assert math.isnan(number(kept, "dcpa")) and math.isnan(number(kept, "tcpa"))


def test_the_class_is_that_of_the_first_encounter_then_of_the_nearest_ship(
    make_case: Callable[..., Case],
) -> None:
    # Both meet own ship after 20 s: one ahead, one nearer from port.
    ahead, crossing = (0.0, 600.0, 270.0, 15.0), (-212.1, 87.9, 45.0, 15.0)
    both = measure(make_case(ahead, crossing), (STRAIGHT, 10))
    assert both.encounters[0] == "stand on"
    assert len(both.known("rule_14")) == len(both.known("rule_17")) == 1
    # The crossing ship meets own ship after 35 s, so its encounter begins later.
    later = (-525.0, 525.0, 0.0, 15.0)
    assert measure(make_case(later, ahead), (STRAIGHT, 10)).encounters[0] == "head-on"


def test_rows_are_measured_alone_and_can_be_selected(make_case: Callable[..., Case]) -> None:
    case = load_case("imazu05", WORLD)
    ways = [[STARBOARD] * 8 + [STRAIGHT] * 30, [STRAIGHT] * 12, [PORT] * 4 + [STRAIGHT] * 20]
    episodes = [episode(WORLD, track(WORLD, case, *[(one, 1) for one in way]), way) for way in ways]
    together = measure_episodes(episodes, WORLD)
    for row, one in enumerate(episodes):
        alone = measure_episodes([one], WORLD)
        assert together.of_episode(row) == pytest.approx(alone.of_episode(0), nan_ok=True)
    assert together.outcomes.tolist() == ["timeout", "timeout", "timeout"]
    some = together.select(together.values["steps"] > 20)
    assert len(some.outcomes) == 2 and len(some.known("rule_8")) == 4


IMAZU = {number: load_case(f"imazu{number:02}", WORLD) for number in (1, 2, 3, 4, 14)}


@dataclass
class Ship:
    """What an episode did about its first target ship; `rules` by their numbers."""

    encounter: Encounter
    onset: int
    manoeuvre: int
    rules: dict[int, float]


def score(case: Case, *held: tuple[int, int]) -> Ship:
    states = track(WORLD, case, *held)
    found = score_rules(states[None], torch.tensor([len(states) - 1]), WORLD)
    kind, onset, manoeuvre = (part[0, 0].item() for part in found[:3])
    known = dict(zip(RULES, found.rules[0, 0].tolist(), strict=True))
    rules = {rule: value for rule, value in known.items() if not math.isnan(value)}
    return Ship(Encounter(int(kind)), int(onset), int(manoeuvre), rules)


def test_a_collision_is_unsafe_and_not_timely() -> None:
    one = score(IMAZU[1], (STRAIGHT, 30))
    assert (one.encounter, one.onset, one.manoeuvre) == (Encounter.HEAD_ON, 0, -1)
    assert one.rules == {8: 0, 14: 0}


def test_head_on_wants_a_starboard_turn() -> None:
    right = score(IMAZU[1], (STARBOARD, 8), (STRAIGHT, 25))
    left = score(IMAZU[1], (PORT, 8), (STRAIGHT, 25))
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
    assert 0 < late.rules[16] < late.rules[8]


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
    assert set(kept.rules) == {17} and kept.rules[17] > 0
    assert turned.rules == {17: 0}


def safety(distance: float, bearing: float = 0.0, aspect: float = 0.0) -> float:
    one, other, third = torch.tensor([distance, bearing, aspect], dtype=torch.float64)
    return safety_score(one, other, third, WORLD.safe_distance).item()


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
