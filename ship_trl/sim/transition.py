"""One simulation step as a pure function of states and actions."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import STEP, advance, target_positions
from ship_trl.sim.geometry import angle_off_bow, closest_approach
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, POSITION_TOLERANCE, reward_constants, step_reward


class Outcome(NamedTuple):
    """Results of one step of N ships.

    Attributes:
        state: states after the step, float32 [N, 4].
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


class Transition:
    """The simulation step of one case, in torch on any device.

    `transition(state, action)` maps float32 [N, 4] and int64 [N] to an `Outcome`.

    Attributes:
        actions: speed (m/s) and rate of turn (rad/s) of each action, [A, 2].
        goal: position of the goal (m), [2].
        start: initial state, [4].
        ship_start: initial positions of the target ships (m), [K, 2].
        ship_velocity: velocities of the target ships (m/s), [K, 2].
    """

    def __init__(self, case: Case, world: World, device: torch.device) -> None:
        self.world, self.constants = world, reward_constants(world.reward)
        tensor = lambda values: torch.tensor(values, dtype=torch.float32, device=device)  # noqa: E731
        self.actions = tensor(world.actions)
        self.goal = tensor(case.goal)
        self.start = tensor([*case.start, math.radians(case.heading), 0.0])
        ships = case.target_ships
        course = [math.radians(ship.heading) for ship in ships]
        self.ship_start = tensor([[s.x, s.y] for s in ships]).reshape(-1, 2)
        self.ship_velocity = tensor(
            [[s.speed * math.cos(c), s.speed * math.sin(c)] for s, c in zip(ships, course, strict=True)]
        ).reshape(-1, 2)

    def goal_distance(self, state: Tensor) -> Tensor:
        """Return the distances to the goal in metres, [...], for states [..., 4]."""
        return torch.linalg.vector_norm(self.goal - state[..., :2], dim=-1)

    def relative_positions(self, state: Tensor) -> Tensor:
        """Return the target ships' positions relative to own ship in metres, [N, K, 2], for states [N, 4]."""
        ships = target_positions(state, self.ship_start, self.ship_velocity, self.world.dt)
        return ships - state[:, None, :2]

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship: states float32 [N, 4], action indices int64 [N]."""
        world = self.world
        after = advance(state, action, self.actions, world.dt)
        distances = closest_approach(self.relative_positions(state), self.relative_positions(after))
        nearest = distances.amin(-1) if distances.shape[-1] else torch.full_like(state[:, 0], math.inf)
        distance = self.goal_distance(after)
        collision = nearest < world.safe_distance
        # A collision takes precedence over reaching the goal in the same step.
        goal = (distance <= world.goal_distance + POSITION_TOLERANCE) & ~collision
        off_bow = angle_off_bow(after[:, :2], after[:, 2], self.goal)
        flags = goal.to(distance.dtype), collision.to(distance.dtype)
        speed, turn = self.actions[action].unbind(-1)
        reward = step_reward(
            self.constants, distance, off_bow, *flags, nearest.clamp(max=MAX_SHIP_DISTANCE), speed, turn
        )
        truncated = (after[:, STEP] >= world.max_steps) & ~goal & ~collision
        return Outcome(after, reward, goal, collision, truncated, nearest)
