"""Upper bound of the return to come, by dynamic programming on a grid.

Without target ships the return to come depends only on the goal's distance, its angle off the bow and the
steps left. With target ships, each step assumes the ship distance with the highest reward.
"""

from __future__ import annotations

import math
from functools import reduce

import torch
from torch import Tensor

from ship_trl.sim.dynamics import advance
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, POSITION_TOLERANCE, PaidStep, step_reward
from ship_trl.sim.state import HEADING, OWN_SIZE, SHIP_COUNT, STEP, X, goal, goal_distance, position
from ship_trl.sim.transition import Transition

# With this grid, the error of a return in the paper's world is about one point.
GRID_STEPS_PER_ACTION = 2
GRID_ANGLES = 96
# Distances (m) to the nearest ship for which the reward is computed, each about a fifth larger than the last.
# `_best_rewards` adds both sides of the safe distance.
SHIP_DISTANCES = (1e-3, *torch.logspace(0, math.log10(MAX_SHIP_DISTANCE), 76).tolist())

# Bound of the interpolation error, as a share of the range of a step's reward.
MAX_ERROR_SHARE = 1 / 150


class ValueBound:
    """Upper bound of the return to come in one case, valid for any positions of its target ships.

    `value_bound(state)` takes float [N, S], all at the same step, and returns float [N]. No plan gains more
    than this bound plus `max_error` (raw reward), within two limits:

    - The reward must be as smooth in the goal's distance and angle as the paper's. As a function of the
      nearest ship's distance it may jump only at the safe distance, and must hardly change between distances
      a fifth apart.
    - Within two goal distances of the goal the grid is too coarse to tell which states reach it. There the
      bound may be too low by more than `max_error`.

    With lags own ship may have any speed and rate of turn of the actions, in any pair, in each step.

    `start` [S] is the case's initial state. The grid has `rows` goal distances, `row_spacing` metres apart,
    and `GRID_ANGLES` angles, `column_spacing` radians apart. `table` [max_steps + 1, rows * GRID_ANGLES] has
    the returns by steps left.
    """

    def __init__(self, transition: Transition, start: Tensor) -> None:
        self.transition = transition
        self._has_ships = bool(start[SHIP_COUNT] > 0)
        world, motions = transition.world, possible_motions(transition)
        count = len(motions)
        reach = float(transition.actions[:, 0].abs().max()) * world.dt
        self.row_spacing = reach / GRID_STEPS_PER_ACTION
        self.column_spacing = 2 * math.pi / GRID_ANGLES
        farthest = float(goal_distance(start)) + reach * world.max_steps
        self.rows = math.ceil(farthest / self.row_spacing) + 2
        # The goal is at the origin, own ship west of it, with each of the grid's angles off the bow.
        state = torch.zeros(self.rows, GRID_ANGLES, OWN_SIZE)
        state[..., X] = -(torch.arange(self.rows) * self.row_spacing)[:, None]
        state[..., HEADING] = math.pi - torch.arange(GRID_ANGLES) * self.column_spacing
        before = state.reshape(-1, 1, OWN_SIZE).expand(-1, count, -1)
        after = advance(before, torch.arange(count).expand(len(before), -1), motions, world.dt)
        distance = goal_distance(after)
        off_bow = angle_off_bow(position(after), after[..., HEADING], goal(after))
        at_goal = distance <= world.goal_distance + POSITION_TOLERANCE
        reward, collision = self._best_rewards(distance, off_bow, at_goal)
        self.max_error = MAX_ERROR_SHARE * float(reward.max() - reward.min())
        corners, weights = self._corners(distance, off_bow)
        self.table = torch.zeros(world.max_steps + 1, self.rows * GRID_ANGLES)
        for steps_left in range(world.max_steps):
            following = (self.table[steps_left][corners] * weights).sum(-1).masked_fill(at_goal, 0.0)
            self.table[steps_left + 1] = torch.maximum(reward + following, collision).amax(-1)

    def _best_rewards(self, distance: Tensor, off_bow: Tensor, at_goal: Tensor) -> tuple[Tensor, Tensor]:
        """Return the highest rewards of a step without and with a collision, [..., M] each.

        With another reward formula, being near a ship or ending early may be best. Without target ships the
        reward of a collision is minus infinity.
        Shapes, after the step: distance to the goal (m), off_bow (theta_2, rad), whether at_goal: [..., M].
        """
        actions = self.transition.actions
        # Without lags each motion is an action's, else it may be the motion of any.
        paid = [actions.unbind(-1)] if self.transition.lags is None else actions.tolist()
        reached, zero = at_goal.to(distance.dtype), torch.zeros_like(distance)

        def rewards(nearest: float, reached: Tensor, collided: Tensor) -> Tensor:
            seen = distance, off_bow, reached, collided, zero + nearest
            steps = (PaidStep(*seen, speed, turn) for speed, turn in paid)
            found = (step_reward(self.transition.amounts, step) for step in steps)
            return reduce(torch.maximum, found)

        reward, collision = rewards(MAX_SHIP_DISTANCE, reached, zero), zero - math.inf
        safe = self.transition.world.safe_distance
        distances = (*SHIP_DISTANCES, safe, safe - POSITION_TOLERANCE)
        for nearest in distances if self._has_ships else ():
            if nearest < safe:
                collision = torch.maximum(collision, rewards(nearest, zero, zero + 1.0))
            else:
                reward = torch.maximum(reward, rewards(nearest, reached, zero))
        return reward, collision

    def _corners(self, distance: Tensor, off_bow: Tensor) -> tuple[Tensor, Tensor]:
        """Return the four grid points around each distance and angle, and their weights, both [..., 4]."""
        row = (distance / self.row_spacing).clamp(max=self.rows - 1.001)
        column = (off_bow + math.pi) / self.column_spacing
        low, left = row.floor(), column.floor()
        up, right = row - low, column - left
        low, left = low.long() * GRID_ANGLES, left.long() % GRID_ANGLES
        high, next_right = low + GRID_ANGLES, (left + 1) % GRID_ANGLES
        corners = torch.stack((low + left, low + next_right, high + left, high + next_right), -1)
        weights = torch.stack(((1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right), -1)
        return corners, weights

    def __call__(self, state: Tensor) -> Tensor:
        """Return the upper bounds [N] of states [N, S], which must all be at the same step."""
        off_bow = angle_off_bow(position(state), state[:, HEADING], goal(state))
        corners, weights = self._corners(goal_distance(state), off_bow)
        steps_left = max(0, self.transition.world.max_steps - int(state[0, STEP]))
        return (self.table[steps_left][corners] * weights).sum(-1)


def possible_motions(transition: Transition) -> Tensor:
    """Return mean speeds and rates of turn that own ship may have in a step, [M, 2]."""
    if transition.lags is None:
        return transition.actions
    speeds, turns = transition.actions.unbind(-1)
    return torch.cartesian_prod(speeds.unique(), turns.unique())
