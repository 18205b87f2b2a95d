"""The returns that scores refer to: best known plans, searched for once and checked, and random actions."""

import json
from functools import partial
from pathlib import Path

import pytest
import torch
from torch import Generator

from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Perturbation, World
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.learn.rollout import rollout
from ship_trl.policies import reference
from ship_trl.policies.planner import Plan, best_plan
from ship_trl.sim.cases import Case, load_case, load_suite, load_world, suite_of

WORLD = load_world()


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of searched cases, with empty caches; a search finds the bundled plan."""
    found: list[str] = []
    plans = {name: reference.best_known(load_case(name, WORLD), WORLD) for name in "12"}

    def counted(case: Case, world: World) -> Plan:
        found.append(case.name)
        return plans[case.name]

    monkeypatch.setattr(reference, "_cached_plans", {})
    monkeypatch.setattr(reference, "BUNDLED_PLANS", Path("nothing"))
    monkeypatch.setattr(reference, "best_plan", counted)
    return found


def test_a_plan_is_searched_for_once(searches: list[str], tmp_path: Path) -> None:
    case = load_case("2", WORLD)
    first = reference.best_known(case, WORLD, tmp_path / "plans")
    assert reference.best_known(case, WORLD) == first and searches == ["2"]
    reference._cached_plans.clear()
    assert reference.best_known(case, WORLD, tmp_path / "plans") == first and searches == ["2"]
    reference.best_known(load_case("1", WORLD), WORLD, tmp_path / "plans")
    assert searches == ["2", "1"]


@pytest.mark.parametrize(
    "text",
    ["", '{"return": 1}', '{"return": 1e9, "actions": [3]}', '{"return": 1, "actions": [99]}', "[" * 200_000],
)
def test_a_damaged_plan_is_searched_for_again(searches: list[str], tmp_path: Path, text: str) -> None:
    case = load_case("2", WORLD)
    first = reference.best_known(case, WORLD, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_text(text)
    reference._cached_plans.clear()
    assert reference.best_known(case, WORLD, tmp_path) == first and searches == ["2", "2"]
    assert json.loads(path.read_text())["actions"] == first.actions


def test_every_bundled_case_has_its_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = [load_case(str(path), WORLD) for path in sorted((conf_dir() / "case").glob("*.yaml"))]
    names = {reference.plan_name(case, WORLD) for case in cases}
    # If this fails, run `python -m studies.scenes plans`.
    assert {path.name for path in reference.BUNDLED_PLANS.iterdir()} == names
    monkeypatch.setattr(reference, "_cached_plans", {})
    monkeypatch.delattr(reference, "best_plan")
    kept = {case.name: reference.best_known(case, WORLD) for case in cases}
    monkeypatch.undo()
    assert best_plan(load_case("1", WORLD), WORLD) == kept["1"]


def test_of_a_suite_the_mean_is_known_unless_its_starts_are_drawn() -> None:
    paper = load_suite("paper", WORLD)
    returns = [reference.best_known(case, WORLD).episode_return for case in paper.cases]
    assert reference.best_known_return(paper, WORLD) == pytest.approx(sum(returns) / 7)
    assert reference.best_known_return(suite_of(paper.cases[3]), WORLD) == returns[3]
    drawn = Perturbation(own_heading=1.0)
    assert reference.best_known_return(suite_of(paper.cases[3], drawn), WORLD) is None


def test_where_holding_course_is_best_nothing_is_avoided() -> None:
    def is_best(name: str) -> bool:
        suite = load_suite(name, WORLD)
        return reference.is_course_best(suite, WORLD, reference.best_known_return(suite, WORLD))

    names = ("1", "2", "3", "4", "5", "6", "new", "ship")
    assert [name for name in names if is_best(name)] == ["1", "2", "new"]
    assert not is_best("paper") and not reference.is_course_best(load_suite("2", WORLD), WORLD, None)


@pytest.mark.parametrize("name", ["1", "4"])
def test_it_is_the_mean_of_episodes_of_the_environment(name: str) -> None:
    case = load_suite(name, WORLD)
    env, generator = make_env(case, WORLD, 400), Generator().manual_seed(5)
    current, total, running = env.reset(), torch.zeros(400), torch.ones(400, dtype=torch.bool)
    for _ in range(WORLD.max_steps):
        after = env.step(current.set("action", torch.randint(7, (400,), generator=generator)))["next"]
        total += after["reward"][:, 0] * running
        running &= ~after["done"][:, 0]
        current = after.exclude("reward")
    assert not running.any()
    error = float(total.std()) / 20
    assert abs(reference.random_return(case, WORLD, 1) - float(total.mean())) < 3.5 * error


def test_it_depends_on_its_seed_alone() -> None:
    case = load_suite("2", WORLD)
    torch.manual_seed(0)
    first = reference.random_return(case, WORLD, 3, episodes=500)
    torch.manual_seed(1)
    assert (
        reference.random_return(case, WORLD, 3, episodes=500)
        == first
        != reference.random_return(case, WORLD, 4, episodes=500)
    )


def test_drawn_starts_have_a_best_plan_too_and_ships_that_react_do_so_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reference, "best_plan_from", partial(reference.best_plan_from, beam=300))
    suite = load_suite("traffic_reacting", WORLD)
    env = make_env(suite, WORLD, 3, starts=draw_starts(suite, WORLD, 3, 4))
    searched, straight = (
        rollout(env, make(env)) for make in (reference.follow_best_known, reference.keep_course)
    )
    for best, other in zip(searched, straight, strict=True):
        planned = reference.best_plan_from(best.states[0], suite, WORLD)
        assert best.actions.tolist() == planned.actions and best.goal
        assert best.episode_return == pytest.approx(planned.episode_return, abs=1e-2)
        assert best.episode_return >= other.episode_return
