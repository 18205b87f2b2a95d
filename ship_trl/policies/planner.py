"""Search for the action sequence with the greatest return: beam search.

The simulation is deterministic, so a sequence of actions is a plan. Its return is a lower bound of the
optimal return, with which results are compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.policies.value_bound import ValueBound
from ship_trl.sim.cases import Case
from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.state import (
    HEADING,
    SHIP_HEADING,
    SHIP_SPEED,
    SPEED,
    YAW_RATE,
    initial_state,
    is_present,
    position,
    relative_positions,
    target_ships,
)
from ship_trl.sim.transition import Transition


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
    transition, start = Transition(world), initial_state(case, world)
    value_bound = ValueBound(transition, start)
    best = Plan(-math.inf, [], False)
    for resolution in RESOLUTIONS:
        best = search(start, transition, value_bound, beam, resolution, best)
    return best


def search(
    start: Tensor,
    transition: Transition,
    value_bound: ValueBound,
    beam: int,
    resolution: Resolution,
    best: Plan,
) -> Plan:
    """Run one beam search on the CPU, near the best plan so far; return that plan if nothing is better.

    Args:
        start: the case's initial state, [S].
        transition: the simulation step, on the CPU.
        value_bound: upper bound of the return to come, which prunes plans.
        beam: maximum number of plans kept from one step to the next.
        resolution: which plans count as similar, and how far they may be from `best`.
        best: best plan so far; its actions may be empty.
    """
    best_positions = plan_positions(start, transition, best.actions)
    state, total = start[None], torch.zeros(1, dtype=torch.float64)
    history = torch.zeros(1, 0, dtype=torch.int8)
    while len(state):
        action = torch.arange(len(transition.actions)).repeat(len(state))
        parent = torch.arange(len(state)).repeat_interleave(len(transition.actions))
        after = transition(state[parent], action)
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


def plan_positions(start: Tensor, transition: Transition, actions: list[int]) -> Tensor:
    """Return own ship's positions in metres after each of T actions, [T, 2]."""
    state, positions = start[None], [torch.zeros(0, 2)]
    for action in actions:
        state = transition(state, torch.tensor([action])).state
        positions.append(position(state))
    return torch.cat(positions)


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
        state[:, HEADING, None] / resolution.heading,
        passing[:, None] / resolution.passing,
    ]
    if transition.lags is not None:
        cells.append(state[:, SPEED : YAW_RATE + 1] / torch.tensor(RATE_CELLS))
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
    own_velocity = float(transition.actions[:, 0].max()) * unit_vector(state[:, HEADING])
    ships = target_ships(state)
    velocity = ships[..., SHIP_SPEED, None] * unit_vector(ships[..., SHIP_HEADING]) - own_velocity[:, None]
    time = -(away * velocity).sum(-1) / (velocity * velocity).sum(-1).clamp(min=1e-6)
    distance = torch.linalg.vector_norm(away + time[..., None] * velocity, dim=-1)
    ahead = is_present(state) & (time > 0)
    return torch.where(ahead, distance, max_distance).amin(-1).clamp(max=max_distance)
