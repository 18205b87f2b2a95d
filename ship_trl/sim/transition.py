"""One simulation step as a pure function of states and actions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.dynamics import advance, give_way, lag_shares
from ship_trl.sim.geometry import angle_off_bow, closest_approach
from ship_trl.sim.reward import (
    MAX_SHIP_DISTANCE,
    POSITION_TOLERANCE,
    PaidStep,
    reward_amounts,
    reward_terms,
    step_reward,
)
from ship_trl.sim.state import HEADING, STEP, goal, goal_distance, is_present, position, relative_positions


class Outcome(NamedTuple):
    """Results of one step of N ships.

    Attributes:
        state: states after the step, float32 [N, S].
        reward: raw rewards (equation 4), float32 [N].
        goal: whether the goal is reached without a collision, bool [N].
        collision: whether a target ship came inside the safe distance within the step, bool [N].
        truncated: whether the episode ends only because of the step limit, bool [N].
        min_distance: least distance (m) to a target ship within the step, float32 [N]; infinite without one.
    """

    state: Tensor
    reward: Tensor
    goal: Tensor
    collision: Tensor
    truncated: Tensor
    min_distance: Tensor


Step = Callable[[Tensor, Tensor], Outcome]


class Transition:
    """The simulation step, in torch on any device.

    `transition(state, action)` maps float32 [N, S] and int64 [N] to an `Outcome`. Every row may be another
    case.

    Attributes:
        actions: speed (m/s) and rate of turn (rad/s) of each action, [A, 2].
        lags: `dynamics.lag_shares` [2, 2], or None without lags.
    """

    def __init__(self, world: World, device: torch.device | str = "cpu") -> None:
        self.world, self.amounts = world, reward_amounts(world.reward)
        self.actions = torch.tensor(world.actions, dtype=torch.float32, device=device)
        has_lags = world.turn_time > 0 or world.speed_time > 0
        self.lags = torch.tensor(lag_shares(world), device=device) if has_lags else None

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship: states float32 [N, S], action indices int64 [N]."""
        world = self.world
        state = give_way(state, world.give_way, world.dt)
        after = advance(state, action, self.actions, world.dt, self.lags)
        distances = closest_approach(relative_positions(state), relative_positions(after))
        distances = distances.masked_fill(~is_present(state), math.inf)
        nearest = distances.amin(-1) if distances.shape[-1] else torch.full_like(state[:, 0], math.inf)
        distance = goal_distance(after)
        collision = nearest < world.safe_distance
        # A collision takes precedence over reaching the goal in the same step.
        reached = (distance <= world.goal_distance + POSITION_TOLERANCE) & ~collision
        paid = self._paid_step(action, after, distance, reached, collision, nearest)
        reward = step_reward(self.amounts, paid)
        truncated = (after[:, STEP] >= world.max_steps) & ~reached & ~collision
        return Outcome(after, reward, reached, collision, truncated, nearest)

    def reward_terms(self, action: Tensor, outcome: Outcome) -> dict[str, Tensor]:
        """Return the raw rewards of steps by term, each [N], for the actions [N] and what they led to."""
        after = outcome.state, goal_distance(outcome.state), outcome.goal, outcome.collision
        return reward_terms(self.amounts, self._paid_step(action, *after, outcome.min_distance))

    def _paid_step(
        self,
        action: Tensor,
        after: Tensor,
        distance: Tensor,
        reached: Tensor,
        collision: Tensor,
        nearest: Tensor,
    ) -> PaidStep:
        """Return what steps are paid for; `distance` (m) is to the goal, `nearest` to the nearest ship."""
        off_bow = angle_off_bow(position(after), after[:, HEADING], goal(after))
        flags = reached.to(distance.dtype), collision.to(distance.dtype)
        speed, turn = self.actions[action].unbind(-1)
        return PaidStep(distance, off_bow, *flags, nearest.clamp(max=MAX_SHIP_DISTANCE), speed, turn)
