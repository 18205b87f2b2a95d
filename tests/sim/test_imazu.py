"""The 22 Imazu problems as case files: where all ships meet, who gives way, and that none repeats another."""

import math
from collections import Counter

import pytest

from ship_trl.policies.reference import best_known
from ship_trl.sim.cases import Case, load_case, load_suite, load_world
from ship_trl.sim.encounter import Encounter, classify, relative_motion
from ship_trl.sim.state import initial_state

WORLD = load_world()
SUITE = load_suite("imazu", WORLD)
VARIANTS = ("imazu08_printed", "imazu12_waltz", "imazu22_printed")
CASES = {case.name: case for case in (*SUITE.cases, *(load_case(name, WORLD) for name in VARIANTS))}


def classes(case: Case) -> list[Encounter]:
    motion = relative_motion(initial_state(case, WORLD).double())
    found = classify(motion.bearing, motion.aspect, math.radians(5))
    return [Encounter(one) for one in found.tolist()]


def test_there_are_22_problems_with_51_target_ships() -> None:
    assert [case.name for case in SUITE.cases] == [f"imazu{number:02d}" for number in range(1, 23)]
    assert [len(case.target_ships) for case in SUITE.cases] == [1] * 4 + [2] * 7 + [3] * 11


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_every_ship_meets_own_ship_at_the_origin(case: Case) -> None:
    assert (case.start, case.heading, case.goal) == ([0.0, -300.0], 90.0, [0.0, 300.0])
    motion = relative_motion(initial_state(case, WORLD).double())
    assert motion.dcpa.max() < 1e-4
    assert motion.tcpa.tolist() == pytest.approx([20.0] * len(case.target_ships), abs=1e-4)
    for ship in case.target_ships:
        angle = math.radians(ship.heading)
        end = ship.x + 20 * ship.speed * math.cos(angle), ship.y + 20 * ship.speed * math.sin(angle)
        # Six digits of the unit.
        assert end == pytest.approx((0.0, 0.0), abs=3e-5)


def test_the_roles_are_those_of_the_source() -> None:
    found = Counter(one for case in SUITE.cases for one in classes(case))
    assert found == {
        Encounter.GIVE_WAY: 28, Encounter.STAND_ON: 12, Encounter.HEAD_ON: 5, Encounter.OVERTAKING: 6
    }  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_bundled_plan_reaches_the_goal(case: Case) -> None:
    plan = best_known(case, WORLD)
    assert plan.goal and plan.episode_return > 45
