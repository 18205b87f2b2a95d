"""The policy `recorded`: own ship goes where it really was, judged by the same rules as any policy."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import torch
from tensordict import TensorDictBase

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.learn.rollout import Episode, Policy, rollout
from ship_trl.sim.cases import Case, Suite
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import STEP, state_size

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


def follow_track(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that takes a world's actions one after the other; see `rollout_recorded`.

    Raises:
        ConfigError: no case has a recorded track, or starts are perturbed.
    """
    if env.suite.is_drawn or not any(case.track for case in env.suite.cases):
        raise ConfigError(f"policy: {NAME} is known of AIS traffic alone; allowed: target=FILE of positions")
    last = len(env.world.actions) - 1

    def policy(step: TensorDictBase) -> TensorDictBase:
        return step.set("action", step["state"][..., STEP].long().clamp(max=last))

    return policy


def rollout_recorded(suite: Suite, world: World) -> list[Episode]:
    """Return the episode of each case's track, with those actions of the world that are most alike.

    Each case has a world of its own, whose actions are what own ship did.

    Raises:
        ConfigError: as `follow_track`.
    """
    episodes, size = [], state_size(max(len(case.target_ships) for case in suite.cases))
    for case in suite.cases:
        # A replayed ship is told by its number in the whole suite, so the suite stays.
        env = make_env(replace(suite, cases=(case,)), replace(world, actions=recorded_actions(case, world)))
        (episode,) = rollout(env, follow_track(env))
        taken = torch.tensor(env.world.actions)[episode.actions]
        # A rate of turn counts a hundred times: 0.1 rad/s as much as 10 m/s.
        apart = (taken[:, None] - torch.tensor(world.actions)) * torch.tensor([1.0, 100.0])
        nearest = torch.linalg.vector_norm(apart, dim=-1).argmin(-1)
        # As many places for target ships as in the other cases.
        states = torch.nn.functional.pad(episode.states, (0, size - episode.states.shape[-1]))
        episodes.append(replace(episode, states=states, actions=nearest))
    return episodes
