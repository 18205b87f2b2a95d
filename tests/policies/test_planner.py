"""The planner: returns of its plans, and their rollouts in the environment."""

from collections.abc import Callable

import pytest
import torch

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.policies.planner import Plan, ValueBound, best_plan
from ship_trl.policies.reference import best_known
from ship_trl.sim.cases import Case, load_case
from ship_trl.sim.reward import TERMS, PaidStep, Term
from ship_trl.sim.state import goal_distance, initial_state
from ship_trl.sim.transition import Transition
from tests.sim.scenes import scenes

MakeCase = Callable[..., Case]
BEST = {"1": 83.89, "2": 83.89, "3": 63.7, "4": 43.2, "5": 62.6, "6": 53.3, "new": 83.89, "ship": 63.7}


def run_plan(case: Case, world: World, plan: Plan) -> tuple[float, bool, bool]:
    """Roll out a plan; return its return, and whether the episode has ended and the goal is reached."""
    env = make_env(case, world)
    step, total = env.reset(), 0.0
    for index, action in enumerate(plan.actions):
        assert not bool(step["done"]), f"ended before action {index}"
        step = env.step(step.set("action", torch.tensor([action])))["next"]
        total += float(step["reward"])
    return total, bool(step["done"]), bool(step["goal"])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "3" else [pytest.mark.long]) for name in BEST]
)
def test_the_best_known_returns(name: str, world: World) -> None:
    case = load_case(name, world)
    plan = best_plan(case, world)
    assert plan.episode_return >= BEST[name] and plan.goal
    total, ended, goal = run_plan(case, world, plan)
    assert total == pytest.approx(plan.episode_return, abs=1e-3) and ended and goal


def test_a_goal_out_of_reach_still_has_a_best_plan(world: World, make_case: MakeCase) -> None:
    case = make_case(goal=[0.0, 1500.0])
    plan = best_plan(case, world, beam=500)
    assert not plan.goal and plan.actions == [3] * 60
    wanted = -0.01 * sum(1500 - 15 * step for step in range(1, 61))
    assert plan.episode_return == pytest.approx(wanted, abs=1e-2)
    total, ended, goal = run_plan(case, world, plan)
    assert total == pytest.approx(plan.episode_return, abs=1e-2) and ended and not goal


def test_the_bound_is_the_return_without_target_ships(world: World, make_case: MakeCase) -> None:
    case = make_case()
    bound = ValueBound(Transition(world), initial_state(case, world))
    at = lambda *values: scenes(case, world, [values])  # noqa: E731
    assert float(bound(at(0, 0, torch.pi / 2, 0))) == pytest.approx(83.9, abs=0.5)
    # 5 steps left, 585 to 525 m away at their ends.
    assert float(bound(at(0, 0, torch.pi / 2, 55))) == pytest.approx(-0.01 * 5 * 555, abs=0.2)
    assert float(bound(at(0, 0, torch.pi / 2, 60))) == 0.0
    port, starboard, away = (float(bound(at(0, 0, h, 0))) for h in (2.2, torch.pi - 2.2, -torch.pi / 2))
    assert port == pytest.approx(starboard, abs=0.1) and away < port < 83.0


# Terms added to the paper's reward.
MORE_TERMS: dict[str, Callable[[PaidStep], float]] = {
    "time": lambda step: 0.0 * step.nearest - 20.0,
    "keeping near": lambda step: 5.0 * (step.nearest < 150.0),
    "near, yet clear": lambda step: (1 - step.collided) * 4500.0 / step.nearest,
    "colliding": lambda step: 300.0 * step.collided,
    "rudder": lambda step: -20.0 * abs(step.turn),
}


@pytest.mark.parametrize("term", MORE_TERMS)
def test_no_episode_gains_more_than_its_bound(
    term: str, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = load_case("4", world)
    # The best known plans with and without the term, with increasingly many random actions.
    plans = [best_known(case, world).actions]
    monkeypatch.setitem(TERMS, term, Term(lambda _: 1.0, lambda _, step: MORE_TERMS[term](step)))
    plans.append(best_plan(case, world, beam=500).actions)
    step, generator = Transition(world), torch.Generator().manual_seed(0)
    start, count = initial_state(case, world), 1000
    bound = ValueBound(step, start)
    best = torch.tensor([plan + [3] * (60 - len(plan)) for plan in plans]).repeat(count // 2, 1)
    is_random = torch.rand(count, 60, generator=generator) < torch.linspace(0, 1, count)[:, None]
    random_actions = torch.randint(7, (count, 20), generator=generator).repeat_interleave(3, 1)
    plan = torch.where(is_random, random_actions, best)
    state, running = start.expand(count, -1), torch.ones(count, dtype=torch.bool)
    rewards, bounds = [], []
    for time in range(60):
        after = step(state, plan[:, time])
        is_far = goal_distance(state) > 2 * world.goal_distance
        bounds.append(torch.where(running & is_far, bound(state), torch.inf))
        rewards.append(after.reward * running)
        running = running & ~(after.goal | after.collision | after.truncated)
        state = after.state
    to_come = torch.stack(rewards).flip(0).cumsum(0).flip(0)
    assert (to_come - torch.stack(bounds)).max() <= bound.max_error
    assert not running.any()
