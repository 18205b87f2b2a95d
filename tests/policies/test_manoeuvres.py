"""Held manoeuvres, and the policies that follow the best of them."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.manoeuvres import arrives
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.policies.manoeuvres import BestManoeuvre, Manoeuvres, best_rules
from ship_trl.policies.metrics import score_rules
from ship_trl.sim.cases import GIVES_WAY, HOLDS_COURSE, load_world
from ship_trl.sim.state import SHIP_BEHAVIOUR, target_ships
from ship_trl.sim.transition import Transition

WORLD = load_world()


@pytest.mark.parametrize("reacting", [False, True])
@pytest.mark.parametrize(
    "world", [WORLD, replace(WORLD, turn_time=2.0, speed_time=4.0)], ids=["paper", "lags"]
)
def test_the_prediction_is_what_the_simulator_does(world: World, reacting: bool) -> None:
    manoeuvres = Manoeuvres(world)
    table, found = torch.from_numpy(manoeuvres.table), set()
    first = torch.arange(len(table)) % len(world.actions)
    suite = load_suite("traffic", world)
    for start in draw_starts(suite, world, 9, 70):
        numbers = start.double().numpy()
        predicted = [
            arrives(numbers, int(a), plan, manoeuvres.model, reacting)
            for a, plan in zip(first, manoeuvres.table, strict=True)
        ]
        goal = sail(manoeuvres, start, first, table, HOLDS_COURSE)
        if reacting:
            goal &= sail(manoeuvres, start, first, table, GIVES_WAY)
        # At the edge of the safe distance float32 and float64 differ.
        assert (goal != torch.tensor(predicted)).sum() <= 1
        found |= set(predicted)
    assert found == {True, False}


def sail(manoeuvres: Manoeuvres, start: Tensor, first: Tensor, plans: Tensor, behaviour: float) -> Tensor:
    """Return which plans lead to the goal behind their first actions, by the simulator."""
    transition, state = Transition(manoeuvres.world), start.repeat(len(plans), 1)
    target_ships(state)[..., SHIP_BEHAVIOUR] = behaviour
    running, goal = torch.ones(len(plans), dtype=torch.bool), torch.zeros(len(plans), dtype=torch.bool)
    for step in range(manoeuvres.world.max_steps):
        action, left = manoeuvres.follow(state, plans)
        after = transition(state, first if step == 0 else action)
        goal |= running & after.goal
        running &= ~(after.goal | after.collision | after.truncated)
        state, plans = after.state, plans if step == 0 else left
    return goal


@pytest.mark.parametrize("name", ["traffic_test", "traffic_dense"])
def test_the_best_manoeuvre_solves_what_the_generator_keeps(name: str) -> None:
    suite = load_suite(name, WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 30, 40))
    by_return, by_rules = rollout(env, BestManoeuvre(env)), rollout(env, best_rules(env))
    assert all(one.goal for one in (*by_return, *by_rules))
    assert all(a.episode_return >= b.episode_return - 1e-3 for a, b in zip(by_return, by_rules, strict=True))

    def score(episodes: list[Episode]) -> float:
        return sum(
            float(
                score_rules(one.states[None], torch.tensor([one.length]), WORLD).rules.nan_to_num(1.0).mean()
            )
            for one in episodes
        )

    assert score(by_rules) > score(by_return)
