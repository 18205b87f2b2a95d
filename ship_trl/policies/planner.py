"""Search for the action sequence with the greatest return: beam search.

The simulation is deterministic, so a sequence of actions is a plan. Its return is a lower bound of the
optimal return, with which results are compared. Plans are pruned by an upper bound of the return to come, by
dynamic programming on a grid: without target ships that return depends only on the goal's distance, its angle
off the bow and the steps left. With target ships, each step assumes the ship distance with the highest
reward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim import state as col
from ship_trl.sim.cases import Case, Suite, suite_of
from ship_trl.sim.encounter import ship_velocities
from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.replay import with_replay
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, POSITION_TOLERANCE, PaidStep, step_reward
from ship_trl.sim.state import (
    goal_distance,
    goal_off_bow,
    initial_state,
    is_present,
    position,
    relative_positions,
)
from ship_trl.sim.transition import Step, Transition, advance


class Resolution(NamedTuple):
    """Resolution of one beam search, which keeps the best plan of each cell at each step.

    Plans share a cell if their position (m), heading (rad) and passing distance (m) are similar; with lags,
    their speed and rate of turn too. Plans stay within `max_deviation` (m) of the best plan so far.
    """

    position: float
    heading: float
    passing: float
    max_deviation: float


# The first search covers everything, the others are finer and stay near the best plan so far.
RESOLUTIONS = (
    Resolution(8.0, 0.05, 1.0, math.inf),
    Resolution(4.0, 0.03, 1.0, 40.0),
    Resolution(2.0, 0.02, 0.5, 20.0),
)
# Ranks plans lower that will pass inside the safe distance: a metre too close counts like this many metres
# to the goal in one step. Without it, plans that will collide crowd out plans that give way.
CLOSENESS_PENALTY = 50.0
# Speed (m/s) and rate of turn (rad/s) that a cell spans, where own ship follows its actions with lags.
RATE_CELLS = (1.0, 0.02)
# With this grid, the error of a return in the paper's world is about one point.
GRID_STEPS_PER_ACTION = 2
GRID_ANGLES = 96
# Distances (m) to the nearest ship for which the reward is computed, each about a fifth larger than the last.
# `_best_rewards` adds both sides of the safe distance.
SHIP_DISTANCES = (1e-3, *torch.logspace(0, math.log10(MAX_SHIP_DISTANCE), 76).tolist())

# Bounds of the interpolation error: a share of the range of a step's rewards, and more than what a step just
# before the goal costs, by which the value jumps where the goal takes one step more.
MAX_ERROR_SHARE, MAX_JUMP_SHARE = 1 / 150, 1.5


@dataclass(frozen=True)
class Plan:
    """A sequence of action indices, its undiscounted raw return, and whether it ends at the goal."""

    episode_return: float
    actions: list[int]
    goal: bool


def best_plan(case: Case, world: World, beam: int = 6000) -> Plan:
    """Search for the action sequence with the greatest return, even if none reaches the goal; deterministic.

    `beam` is the maximum number of plans kept from one step to the next.
    """
    return best_plan_from(initial_state(case, world), suite_of(case), world, beam)


def best_plan_from(start: Tensor, suite: Suite, world: World, beam: int = 6000) -> Plan:
    """Search as `best_plan` does, from the first state [S] of an episode of a suite."""
    transition = Transition(world)
    step, value_bound = with_replay(transition, suite, world), ValueBound(transition, start)
    best = Plan(-math.inf, [], False)
    for resolution in RESOLUTIONS:
        best = search(start, transition, step, value_bound, beam, resolution, best)
    return best


def search(
    start: Tensor,
    transition: Transition,
    step: Step,
    value_bound: ValueBound,
    beam: int,
    resolution: Resolution,
    best: Plan,
) -> Plan:
    """Run one beam search on the CPU, near the best plan so far; return that plan if nothing is better.

    Args:
        start: the initial state, [S].
        transition: the world's simulation step, on the CPU.
        step: the same, in which recorded ships follow their paths.
        value_bound: upper bound of the return to come, which prunes plans.
        beam: maximum number of plans kept from one step to the next.
        resolution: which plans count as similar, and how far they may be from `best`.
        best: best plan so far; its actions may be empty.
    """
    state, best_positions = start[None], []
    for one in best.actions:
        state = step(state, torch.tensor([one])).state
        best_positions.append(position(state))
    state, total = start[None], torch.zeros(1, dtype=torch.float64)
    history = torch.zeros(1, 0, dtype=torch.int8)
    while len(state):
        action = torch.arange(len(transition.actions)).repeat(len(state))
        parent = torch.arange(len(state)).repeat_interleave(len(transition.actions))
        after = step(state[parent], action)
        totals = total[parent] + after.reward
        ended = after.goal | after.collision | after.truncated
        index = int(totals.masked_fill(~ended, -math.inf).argmax())
        if bool(ended[index]) and float(totals[index]) > best.episode_return:
            actions = [*history[parent[index]].tolist(), int(action[index])]
            best = Plan(float(totals[index]), actions, bool(after.goal[index]))
        bound = totals + value_bound(after.state)
        kept = ~ended & (bound > best.episode_return - value_bound.max_error)
        time = history.shape[1]
        if time < len(best_positions):
            from_best = position(after.state) - best_positions[time]
            kept &= torch.linalg.vector_norm(from_best, dim=-1) <= resolution.max_deviation
        rows = kept.nonzero().squeeze(-1)
        rows = rows[select(bound[rows], after.state[rows], transition, beam, resolution)]
        state, total = after.state[rows], totals[rows]
        history = torch.cat((history[parent[rows]], action[rows, None].to(torch.int8)), dim=1)
    return best


def select(bound: Tensor, state: Tensor, transition: Transition, beam: int, resolution: Resolution) -> Tensor:
    """Return the indices of the best-ranked of N plans, at most one per cell and `beam` in all.

    Shapes: bound [N], upper bounds of the plans' returns; state [N, S], which the plans have reached.
    """
    passing = passing_distance(state, transition)
    weights, safe = transition.world.reward, transition.world.safe_distance
    penalty = abs(weights.w3 * weights.k1) * CLOSENESS_PENALTY
    order = torch.argsort(bound - penalty * (safe - passing).clamp(min=0.0), descending=True, stable=True)
    cells = [
        position(state) / resolution.position,
        state[:, col.HEADING, None] / resolution.heading,
        passing[:, None] / resolution.passing,
    ]
    if transition.lags is not None:
        cells.append(state[:, col.SPEED : col.YAW_RATE + 1] / torch.tensor(RATE_CELLS))
    key = torch.zeros(len(state), dtype=torch.long)
    for column in torch.cat(cells, dim=-1)[order].floor().long().unbind(-1):
        key = key * 10_007 + column
    # The sort by cell is stable, so the best-ranked plan of each cell comes first.
    by_cell = torch.argsort(key, stable=True)
    ordered = key[by_cell]
    is_first = torch.ones(len(key), dtype=torch.bool)
    is_first[1:] = ordered[1:] != ordered[:-1]
    return order[torch.sort(by_cell[is_first]).values[:beam]]


def passing_distance(state: Tensor, transition: Transition) -> Tensor:
    """Return the distances [N] in metres at which states [N, S] will pass the nearest target ship.

    Own ship is assumed to keep its course at full speed, and target ships to hold theirs. Distances are
    clipped at 4/3 of the safe distance. Ships that own ship has passed count as this far away.
    """
    away = relative_positions(state)
    max_distance = transition.world.safe_distance * 4 / 3
    if not away.shape[1]:
        return torch.full_like(state[:, 0], max_distance)
    own_velocity = float(transition.actions[:, 0].max()) * unit_vector(state[:, col.HEADING])
    velocity = ship_velocities(state) - own_velocity[:, None]
    time = -(away * velocity).sum(-1) / (velocity * velocity).sum(-1).clamp(min=1e-6)
    distance = torch.linalg.vector_norm(away + time[..., None] * velocity, dim=-1)
    ahead = is_present(state) & (time > 0)
    return torch.where(ahead, distance, max_distance).amin(-1).clamp(max=max_distance)


class ValueBound:
    """Upper bound of the return to come in one case, valid for any positions of its target ships.

    `value_bound(state)` takes float [N, S], all at the same step, and returns float [N]. No plan gains more
    than this bound plus `max_error` (raw reward), within two limits:

    - The reward must be as smooth in the goal's distance and angle as the paper's. As a function of the
      nearest ship's distance it may jump only at the safe distance, and must hardly change between distances
      a fifth apart.
    - Within two goal distances of the goal, and where only the last steps reach it, the grid is too coarse to
      tell which states reach it. There the bound may be too low by more than `max_error`.

    With lags own ship may have any speed and rate of turn of the actions, in any pair, in each step.

    `start` [S] is the initial state. The grid has `rows` goal distances, `row_spacing` metres apart,
    and `GRID_ANGLES` angles, `column_spacing` radians apart. `table` [max_steps + 1, rows * GRID_ANGLES] has
    the returns by steps left.
    """

    def __init__(self, transition: Transition, start: Tensor) -> None:
        self.transition = transition
        self._has_ships = bool(start[col.SHIP_COUNT] > 0)
        world, motions = transition.world, transition.actions
        if transition.lags is not None:
            # With lags own ship may have any of the speeds and rates of turn.
            motions = torch.cartesian_prod(*(column.unique() for column in motions.unbind(-1)))
        count = len(motions)
        reach = float(transition.actions[:, 0].abs().max()) * world.dt
        self.row_spacing = reach / GRID_STEPS_PER_ACTION
        self.column_spacing = 2 * math.pi / GRID_ANGLES
        farthest = float(goal_distance(start)) + reach * world.max_steps
        self.rows = math.ceil(farthest / self.row_spacing) + 2
        # The goal is at the origin, own ship west of it, with each of the grid's angles off the bow.
        state = torch.zeros(self.rows, GRID_ANGLES, col.OWN_SIZE)
        state[..., col.X] = -(torch.arange(self.rows) * self.row_spacing)[:, None]
        state[..., col.HEADING] = math.pi - torch.arange(GRID_ANGLES) * self.column_spacing
        before = state.reshape(-1, 1, col.OWN_SIZE).expand(-1, count, -1)
        after = advance(before, torch.arange(count).expand(len(before), -1), motions, world.dt)
        distance = goal_distance(after)
        off_bow = goal_off_bow(after)
        at_goal = distance <= world.goal_distance + POSITION_TOLERANCE
        reward, collision = self._best_rewards(distance, off_bow, at_goal)
        before_goal = ~at_goal & (distance <= world.goal_distance + reach)
        jump = -float(reward.masked_fill(~before_goal, -math.inf).max())
        spread = float(reward.max() - reward.min())
        self.max_error = max(MAX_ERROR_SHARE * spread, MAX_JUMP_SHARE * jump)
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
        corners, weights = self._corners(goal_distance(state), goal_off_bow(state))
        steps_left = max(0, self.transition.world.max_steps - int(state[0, col.STEP]))
        return (self.table[steps_left][corners] * weights).sum(-1)
