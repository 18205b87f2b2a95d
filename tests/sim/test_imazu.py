"""The 22 Imazu problems as case files: where all ships meet, who gives way, and that none repeats another."""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from ship_trl.config.errors import ConfigError
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.policies.planner import best_plan
from ship_trl.policies.reference import best_known
from ship_trl.sim import scene
from ship_trl.sim.cases import Case, TargetShip, load_case, load_world
from ship_trl.sim.encounter import Encounter, classify, relative_motion
from ship_trl.sim.state import initial_state, relative_positions
from ship_trl.sim.suites import load_suite

WORLD = load_world()
SUITE = load_suite("imazu", WORLD)
VARIANTS = ("imazu08_printed", "imazu12_waltz", "imazu22_printed")
CASES = {case.name: case for case in (*SUITE.cases, *(load_case(name, WORLD) for name in VARIANTS))}


def classes(case: Case) -> list[Encounter]:
    motion = relative_motion(initial_state(case, WORLD).double())
    found = classify(motion.bearing, motion.aspect, math.radians(5))
    return [Encounter(one) for one in found.tolist()]


def mirrored(case: Case) -> Case:
    ships = [TargetShip(-s.x, s.y, 180.0 - s.heading, s.speed) for s in case.target_ships]
    return replace(case, target_ships=ships)


def courses(name: str) -> list[float]:
    """Courses of the target ships, clockwise from own ship's, from -180 to 180 degrees."""
    return [(270 - ship.heading) % 360 - 180 for ship in CASES[name].target_ships]


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


def test_starboard_is_where_the_give_way_ship_comes_from() -> None:
    bearing = relative_motion(initial_state(CASES["imazu02"], WORLD)).bearing
    assert torch.rad2deg(bearing).tolist() == pytest.approx([45.0])
    assert classes(CASES["imazu02"]) == [Encounter.GIVE_WAY]
    assert classes(CASES["imazu04"]) == [Encounter.STAND_ON]


def test_no_problem_repeats_another_and_the_variants_do() -> None:
    assert len({tuple(sorted(courses(case.name))) for case in SUITE.cases}) == 22
    assert courses("imazu08") == [-180, 90] and courses("imazu08_printed") == courses("imazu05")
    assert sorted(courses("imazu12")) == [-180, -45, 10] and courses("imazu06") == [-10, -45]
    assert sorted(courses("imazu12_waltz")) == [-180, -45, -10]
    assert courses("imazu22") == [0, -30, -90] and courses("imazu22_printed") == courses("imazu15")


def test_a_mirror_image_swaps_the_roles() -> None:
    swapped = {Encounter.GIVE_WAY: Encounter.STAND_ON, Encounter.STAND_ON: Encounter.GIVE_WAY}
    for case in CASES.values():
        assert classes(mirrored(case)) == [swapped.get(one, one) for one in classes(case)]


def test_the_view_shows_all_ships() -> None:
    draw = make_rasteriser(WORLD)
    lone = draw(initial_state(replace(SUITE.cases[0], target_ships=[]), WORLD)).int()
    for case in CASES.values():
        for ship in case.target_ships:
            state = initial_state(replace(case, target_ships=[ship]), WORLD)
            assert float(relative_positions(state).norm()) < scene.VIEW_RADIUS
            assert int(((draw(state).int() - lone).abs() > 20).sum()) > 10


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_bundled_plan_reaches_the_goal(case: Case) -> None:
    plan = best_known(case, WORLD)
    assert plan.goal and plan.episode_return > 45


QUICK = ("imazu02", "imazu16")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.long]) for name in CASES]
)
def test_the_planner_solves_it(name: str) -> None:
    assert best_plan(CASES[name], WORLD, beam=1000).goal


def test_a_suite_may_have_another_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "suite").mkdir()
    (tmp_path / "suite/wide.yaml").write_text("unit: 540\ncases: [imazu01, imazu18]\n")
    monkeypatch.setattr("ship_trl.sim.suites.conf_dir", lambda: tmp_path)
    with pytest.raises(ConfigError, match=r"imazu01.yaml: goal: cannot be reached: 1020 m .*world.max_steps"):
        load_suite("wide", WORLD)
    long = replace(WORLD, max_steps=120)
    suite = load_suite("wide", long)
    assert suite.cases[0].start == [0.0, -540.0] and suite.cases[0].target_ships[0].y == 540.0
    motion = relative_motion(initial_state(suite.cases[1], long).double())
    assert motion.dcpa.max() < 1e-3 and motion.tcpa.tolist() == pytest.approx([36.0] * 3, abs=1e-4)
    assert suite.fingerprint != replace(suite, cases=(CASES["imazu01"], CASES["imazu18"])).fingerprint
