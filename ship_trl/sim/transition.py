"""One step of the world as a pure function of states and actions."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import STEP, advance, target_positions
from ship_trl.sim.geometry import angle_off_bow, closest_approach
from ship_trl.sim.reward import FAR, ROUNDING, reward_constants, step_reward


class Outcome(NamedTuple):
    """What a step led to, each [N]; `apart` is the closest approach within the step (m)."""

    state: Tensor
    reward: Tensor
    goal: Tensor
    collision: Tensor
    truncated: Tensor
    apart: Tensor


class Transition:
    """The world of one case: states [N, 4] and actions [N] to an `Outcome`."""

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
        """Metres to the goal: [..., 4] to [...]."""
        return torch.linalg.vector_norm(self.goal - state[..., :2], dim=-1)

    def away(self, state: Tensor) -> Tensor:
        """Target ships relative to own ship: [N, 4] to [N, K, 2]."""
        ships = target_positions(state, self.ship_start, self.ship_velocity, self.world.dt)
        return ships - state[:, None, :2]

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """One action of each ship: states [N, 4], actions [N]."""
        world = self.world
        after = advance(state, action, self.actions, world.dt)
        apart = closest_approach(self.away(state), self.away(after))
        nearest = apart.amin(-1) if apart.shape[-1] else torch.full_like(state[:, 0], math.inf)
        distance = self.goal_distance(after)
        collision = nearest < world.safe_distance
        # The collision wins over the goal in the same step.
        goal = (distance <= world.goal_distance + ROUNDING) & ~collision
        off_bow = angle_off_bow(after[:, :2], after[:, 2], self.goal)
        ends = goal.to(distance.dtype), collision.to(distance.dtype)
        speed, turn = self.actions[action].unbind(-1)
        reward = step_reward(self.constants, distance, off_bow, *ends, nearest.clamp(max=FAR), speed, turn)
        truncated = (after[:, STEP] >= world.max_steps) & ~goal & ~collision
        return Outcome(after, reward, goal, collision, truncated, nearest)
