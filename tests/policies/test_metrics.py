"""Metrics of episodes whose trajectories are made by hand."""

import math
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.policies.metrics import Measurements, measure_episodes
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.sim.transition import Transition
from tests.policies.tracks import PORT, STARBOARD, STRAIGHT, track

WORLD = load_world()


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
