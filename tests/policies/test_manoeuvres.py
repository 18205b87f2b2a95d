"""Held manoeuvres, and the policies that follow the best of them."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from ship_trl.config.types import World
from ship_trl.fast.worlds import draw_starts, make_env
from ship_trl.foreign.suites import load_suite
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.policies.manoeuvres import Manoeuvres, arrives, best_return, best_rules
from ship_trl.policies.metrics import score_rules
from ship_trl.sim.cases import load_world
from ship_trl.sim.transition import Transition

WORLD = load_world()


@pytest.mark.parametrize(
    "world", [WORLD, replace(WORLD, turn_time=2.0, speed_time=4.0)], ids=["paper", "lags"]
)
def test_the_prediction_is_what_the_simulator_does(world: World) -> None:
    manoeuvres, transition = Manoeuvres(world), Transition(world)
    table, found = torch.from_numpy(manoeuvres.table), set()
    for start in draw_starts(load_suite("traffic_dense", world), world, 6, 70):
        state, plans = start.repeat(len(table), 1), table
        first = torch.arange(len(table)) % len(world.actions)
        predicted = [
            arrives(start.double().numpy(), int(a), plan, manoeuvres.actions, manoeuvres.constants, 3)
            for a, plan in zip(first, manoeuvres.table, strict=True)
        ]
        running, goal = torch.ones(len(table), dtype=torch.bool), torch.zeros(len(table), dtype=torch.bool)
        for step in range(world.max_steps):
            action, left = manoeuvres.follow(state, plans)
            after = transition(state, first if step == 0 else action)
            goal |= running & after.goal
            running &= ~(after.goal | after.collision | after.truncated)
            state, plans = after.state, plans if step == 0 else left
        # At the edge of the safe distance float32 and float64 differ.
        assert (goal != torch.tensor(predicted)).sum() <= 1
        found |= set(predicted)
    assert found == {True, False}


@pytest.mark.parametrize("name", ["traffic", "traffic_dense"])
def test_the_best_manoeuvre_solves_what_the_generator_keeps(name: str) -> None:
    suite = load_suite(name, WORLD)
    env = make_env(suite, WORLD, starts=draw_starts(suite, WORLD, 30, 40))
    by_return, by_rules = rollout(env, best_return(env)), rollout(env, best_rules(env))
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
