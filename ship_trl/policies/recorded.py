"""The policy `recorded`: own ship goes where it really was, judged by the same rules as any policy."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain, pairwise
from typing import NoReturn

import torch
from tensordict import TensorDictBase

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.learn.rollout import Episode, Policy, rollout
from ship_trl.sim.cases import Case, Suite
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import STEP, initial_state

NAME = "recorded"


def recorded_actions(case: Case, world: World) -> list[list[float]]:
    """Return speed (m/s) and rate of turn (rad/s) of each step of a case's track, then straight on."""
    heading, actions = math.radians(case.heading), [list(world.actions[world.straight_action])]
    for (x, y), (east, north) in pairwise([(case.start[0], case.start[1]), *case.track]):
        course = math.atan2(north - y, east - x)
        turn = math.remainder(course - heading, 2 * math.pi)
        actions.append([math.dist((x, y), (east, north)) / world.dt, turn / world.dt])
        heading = course
    return [*actions[1:], [actions[-1][0], 0.0]]


def follow_track(env: ShipEnv) -> Policy:
    """Return the policy of `rollout_recorded`, in whose world the actions of each track follow the last one.

    Raises:
        ConfigError: a case has no recorded track, or starts are perturbed.
    """
    if env.suite.is_drawn or not all(case.track for case in env.suite.cases):
        raise ConfigError(f"policy: {NAME} is known of AIS traffic alone; allowed: target=FILE of positions")
    # As many as `recorded_actions` returns.
    lengths = torch.tensor([len(case.track) + 1 for case in env.suite.cases])
    first = lengths.cumsum(0) - lengths

    def policy(step: TensorDictBase) -> TensorDictBase:
        time = step["state"][..., STEP].long()
        return step.set("action", first + torch.minimum(time, lengths - 1))

    return policy


def refuse_steps(env: ShipEnv, _: int = 0) -> NoReturn:
    """Refuse to make a policy for single steps, whose world has other actions.

    Raises:
        ConfigError: always.
    """
    follow_track(env)
    raise ConfigError(f"policy: {NAME} decides no single step; allowed: in evaluate, watch and record")


def rollout_recorded(suite: Suite, world: World) -> list[Episode]:
    """Return the episode of each case's track, with those actions of the world that are most alike.

    The episodes run side by side, in a world whose actions are what all own ships did. The suite is one
    that `follow_track` takes.
    """
    done = [recorded_actions(case, world) for case in suite.cases]
    places = max(len(case.target_ships) for case in suite.cases)
    starts = [
        initial_state(case, replace(world, actions=actions), places)
        for case, actions in zip(suite.cases, done, strict=True)
    ]
    env = make_env(suite, replace(world, actions=[*chain(*done)]), starts=torch.stack(starts))
    actions, episodes = torch.tensor(env.world.actions), []
    for episode in rollout(env, follow_track(env)):
        # A rate of turn counts a hundred times: 0.1 rad/s as much as 10 m/s.
        apart = (actions[episode.actions][:, None] - torch.tensor(world.actions)) * torch.tensor([1.0, 100.0])
        nearest = torch.linalg.vector_norm(apart, dim=-1).argmin(-1)
        episodes.append(replace(episode, actions=nearest))
    return episodes
