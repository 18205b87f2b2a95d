"""What a plan can still gain where no target ship is in the way: dynamic programming on a grid.

Without target ships the rest of an episode depends on three numbers only: the goal's distance,
its angle off the bow, and the steps left. Where there are ships, they are taken to be where that pays best.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ship_trl.sim.dynamics import HEADING, STEP, advance
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.reward import FAR, ROUNDING, step_reward
from ship_trl.sim.transition import Transition

# Fine enough that the returns of the paper's world are right to about one point.
GRID_STEPS_PER_ACTION = 2
ANGLES = 96
# Metres to the nearest ship that are tried, a fifth apart from one to the next, beside both sides of the
# safe distance.
NEAREST = (1e-3, *torch.logspace(0, math.log10(FAR), 76).tolist())

# How far the interpolation may fall short, as a share of what a step's reward ranges over.
DOUBT = 1 / 150


class ValueBound:
    """The best return to come, for the states of one case, whatever its target ships do.

    `value_bound(state)` takes float [N, 4], all at one step, and returns float [N]. No plan gains more than
    that and `doubt`, the error of the grid, for any reward that is as smooth in distance and angle as the
    paper's, and in the nearest ship's distance hardly changes within a fifth of it, but at the safe distance.
    Within two goal distances of the goal the grid is too coarse to tell who just reaches it: there the bound
    may be short by more.
    """

    def __init__(self, step: Transition) -> None:
        self.step = step
        world, count = step.world, len(step.actions)
        reach = float(step.actions[:, 0].abs().max()) * world.dt
        self.spacing = reach / GRID_STEPS_PER_ACTION
        self.turn = 2 * math.pi / ANGLES
        farthest = float(step.goal_distance(step.start)) + reach * world.max_steps
        self.rows = math.ceil(farthest / self.spacing) + 2
        # The goal at the origin and own ship west of it, heading off by each angle of the grid.
        state = torch.zeros(self.rows, ANGLES, 4)
        state[..., 0] = -(torch.arange(self.rows) * self.spacing)[:, None]
        state[..., HEADING] = math.pi - torch.arange(ANGLES) * self.turn
        after = advance(
            state.reshape(-1, 1, 4).expand(-1, count, 4), torch.arange(count), step.actions, world.dt
        )
        distance = torch.linalg.vector_norm(after[..., :2], dim=-1)
        off_bow = angle_off_bow(after[..., :2], after[..., HEADING], torch.zeros(2))
        goal = distance <= world.goal_distance + ROUNDING
        reward, crash = self._best_rewards(distance, off_bow, goal)
        self.doubt = DOUBT * float(reward.max() - reward.min())
        corners, shares = self._corners(distance, off_bow)
        self.table = torch.zeros(world.max_steps + 1, self.rows * ANGLES)
        for left in range(world.max_steps):
            following = (self.table[left][corners] * shares).sum(-1).masked_fill(goal, 0.0)
            self.table[left + 1] = torch.maximum(reward + following, crash).amax(-1)

    def _best_rewards(self, distance: Tensor, off_bow: Tensor, goal: Tensor) -> tuple[Tensor, Tensor]:
        """Find what a step pays at best and what a collision pays at best, all [..., A].

        Terms of one's own may pay for being near a ship, or make an early end better than to sail on.
        """
        speed, turn = self.step.actions.unbind(-1)
        reached, zero = goal.to(distance.dtype), torch.zeros_like(distance)

        def paid(nearest: float, reached: Tensor, collided: Tensor) -> Tensor:
            ends, ships = (reached, collided), zero + nearest
            return step_reward(self.step.constants, distance, off_bow, *ends, ships, speed, turn)

        reward, crash = paid(FAR, reached, zero), zero - math.inf
        safe = self.step.world.safe_distance
        for nearest in (*NEAREST, safe, safe - ROUNDING) if len(self.step.ship_start) else ():
            if nearest < safe:
                crash = torch.maximum(crash, paid(nearest, zero, zero + 1.0))
            else:
                reward = torch.maximum(reward, paid(nearest, reached, zero))
        return reward, crash

    def _corners(self, distance: Tensor, off_bow: Tensor) -> tuple[Tensor, Tensor]:
        """Find the four grid points around each place and their shares in it, both [..., 4]."""
        row = (distance / self.spacing).clamp(max=self.rows - 1.001)
        column = (off_bow + math.pi) / self.turn
        low, left = row.floor(), column.floor()
        up, right = row - low, column - left
        low, left = low.long() * ANGLES, left.long() % ANGLES
        beside = (left + 1) % ANGLES
        corners = torch.stack((low + left, low + beside, low + ANGLES + left, low + ANGLES + beside), -1)
        shares = torch.stack(((1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right), -1)
        return corners, shares

    def __call__(self, state: Tensor) -> Tensor:
        """Compute the returns to come: states [N, 4] of one step to [N]."""
        off_bow = angle_off_bow(state[:, :2], state[:, HEADING], self.step.goal)
        corners, shares = self._corners(self.step.goal_distance(state), off_bow)
        left = max(0, self.step.world.max_steps - int(state[0, STEP]))
        return (self.table[left][corners] * shares).sum(-1)
