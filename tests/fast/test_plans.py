"""What held manoeuvres earn, as compiled loops, is what they earn in the environment."""

from __future__ import annotations

from functools import partial

import pytest
import torch
from tensordict import TensorDictBase

from ship_trl.config.types import Margin
from ship_trl.fast.plans import PlanValues
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.learn.rollout import rollout
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.policies.metrics import measure_episodes
from ship_trl.sim.cases import load_suite, load_world

WORLD = load_world()
COUNT = 40


@pytest.mark.parametrize("name", ["traffic", "traffic_reacting"])
@pytest.mark.parametrize("changes", [{}, {"turn_time": 2.0, "speed_time": 3.0}])
def test_values_are_returns_of_episodes(name: str, changes: dict[str, float]) -> None:
    world, margin, generator = (
        load_world(changes),
        Margin(65.0, 30.0, 100.0, 300.0),
        torch.Generator().manual_seed(0),
    )
    suite = load_suite(name, world)
    starts = draw_starts(suite, world, COUNT, 0)
    # From the middle of episodes too, where encounters have begun.
    env = make_env(suite, world, starts=starts, margin=margin)
    step = env.reset()
    for _ in range(3):
        _, step = env.step_and_maybe_reset(
            step.set("action", torch.randint(7, (COUNT,), generator=generator))
        )
    values, manoeuvres = PlanValues(world, margin), Manoeuvres(world)
    for begin in (env.reset(), step):
        for plan in values.table[::23]:
            plans, total, current = plan.repeat(COUNT, 1), torch.zeros(COUNT), begin.clone()
            running, first = torch.ones(COUNT, dtype=torch.bool), None
            while bool(running.any()):
                action, plans = manoeuvres.follow(current["state"], plans)
                first = action if first is None else first
                stepped, current = env.step_and_maybe_reset(current.set("action", action))
                total += stepped["next", "reward"][:, 0] * running
                running &= ~stepped["next", "done"][:, 0]
            assert first is not None
            found = values.of_plans(begin["state"], plan[None]).gather(1, first[:, None])[:, 0]
            # Rounding decides some: whether an encounter begins in this step or the next, or between two
            # turns that bring the bow equally near to the goal.
            assert ((found - total).abs() < 0.05).double().mean() > 0.9


def test_each_action_has_a_value_and_the_best_one_solves_random_traffic() -> None:
    suite = load_suite("traffic_test", WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 60, 0))
    values = {weight: PlanValues(WORLD, Margin(65, 30, weight)) for weight in (0.0, 200.0)}

    def act(step: TensorDictBase, weight: float) -> TensorDictBase:
        return step.set("action", values[weight](step["state"]).argmax(-1))

    careless, obeying = (rollout(env, partial(act, weight=weight)) for weight in values)
    assert PlanValues(WORLD, Margin())(env.reset()["state"]).isfinite().all()
    for episodes in (careless, obeying):
        assert sum(one.goal for one in episodes) >= 57
    scores = [measure_episodes(each, WORLD).known("rule_8").mean() for each in (careless, obeying)]
    assert scores[1] > scores[0] + 0.1
