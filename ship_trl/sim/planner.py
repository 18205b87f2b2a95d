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
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import HEADING
from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.transition import Transition
from ship_trl.sim.value_bound import ValueBound


class Resolution(NamedTuple):
    """Resolution of one beam search.

    At each step, plans with similar position, heading and passing distance share a cell, and only the best
    plan of a cell is kept.

    Attributes:
        position: size of a cell in metres, along x and y.
        heading: size of a cell in radians.
        passing: size of a cell in metres of passing distance.
        width: maximum distance in metres from the best plan so far.
    """

    position: float
    heading: float
    passing: float
    width: float


# First search everywhere, then at finer resolution near the best plan so far.
RESOLUTIONS = (
    Resolution(8.0, 0.05, 1.0, math.inf),
    Resolution(4.0, 0.03, 1.0, 40.0),
    Resolution(2.0, 0.02, 0.5, 20.0),
)
# Ranking penalty of a plan that will pass inside the safe distance: each missing metre costs as much as this
# many metres to the goal in one step. Without it, plans that will collide crowd out plans that give way.
METRES_PER_MISSING_METRE = 50.0


@dataclass(frozen=True)
class Plan:
    """A sequence of actions and its outcome.

    Attributes:
        episode_return: undiscounted sum of raw rewards.
        actions: action indices.
        goal: whether the sequence ends at the goal.
    """

    episode_return: float
    actions: list[int]
    goal: bool


def best_plan(case: Case, world: World, beam: int = 6000) -> Plan:
    """Search for the action sequence with the greatest return; deterministic.

    If no sequence found reaches the goal, return the best of the others.

    Args:
        case: where to search.
        world: physics and reward.
        beam: maximum number of plans kept from one step to the next.
    """
    step = Transition(case, world, torch.device("cpu"))
    value_bound = ValueBound(step)
    best = Plan(-math.inf, [], False)
    for resolution in RESOLUTIONS:
        best = search(step, value_bound, beam, resolution, best)
    return best


def search(step: Transition, value_bound: ValueBound, beam: int, resolution: Resolution, best: Plan) -> Plan:
    """Run one beam search; return `best` if it finds nothing better.

    Args:
        step: the case's simulation step, on the CPU.
        value_bound: upper bound of the return to come, which prunes plans.
        beam: maximum number of plans kept from one step to the next.
        resolution: which plans count as similar, and how far they may be from `best`.
        best: best plan so far; its actions may be empty.
    """
    best_positions = plan_positions(step, best.actions)
    state, total = step.start[None], torch.zeros(1, dtype=torch.float64)
    history = torch.zeros(1, 0, dtype=torch.int8)
    while len(state):
        action = torch.arange(len(step.actions)).repeat(len(state))
        parent = torch.arange(len(state)).repeat_interleave(len(step.actions))
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
            from_best = after.state[:, :2] - best_positions[time]
            kept &= torch.linalg.vector_norm(from_best, dim=-1) <= resolution.width
        rows = kept.nonzero().squeeze(-1)
        rows = rows[select(bound[rows], after.state[rows], step, beam, resolution)]
        state, total = after.state[rows], totals[rows]
        history = torch.cat((history[parent[rows]], action[rows, None].to(torch.int8)), dim=1)
    return best


def plan_positions(step: Transition, actions: list[int]) -> Tensor:
    """Return own ship's positions in metres after each of T actions, [T, 2]."""
    state, positions = step.start[None], [torch.zeros(0, 2)]
    for action in actions:
        state = step(state, torch.tensor([action])).state
        positions.append(state[:, :2])
    return torch.cat(positions)


def select(bound: Tensor, state: Tensor, step: Transition, beam: int, resolution: Resolution) -> Tensor:
    """Return the indices of the best-ranked plans, at most one per cell and `beam` in all.

    Args:
        bound: upper bounds of the plans' returns, [N].
        state: states that the plans have reached, [N, 4].
        step: the case's simulation step.
        beam: maximum number of plans.
        resolution: size of a cell.
    """
    passing = passing_distance(state, step)
    weights, safe = step.world.reward, step.world.safe_distance
    penalty = abs(weights.w3 * weights.k1) * METRES_PER_MISSING_METRE
    order = torch.argsort(bound - penalty * (safe - passing).clamp(min=0.0), descending=True, stable=True)
    cells = torch.cat(
        (
            state[:, :2] / resolution.position,
            state[:, HEADING, None] / resolution.heading,
            passing[:, None] / resolution.passing,
        ),
        dim=-1,
    )
    key = torch.zeros(len(state), dtype=torch.long)
    for column in cells[order].floor().long().unbind(-1):
        key = key * 10_007 + column
    # The sort by cell is stable, so the best-ranked plan of each cell comes first.
    by_cell = torch.argsort(key, stable=True)
    ordered = key[by_cell]
    is_first = torch.ones(len(key), dtype=torch.bool)
    is_first[1:] = ordered[1:] != ordered[:-1]
    return order[torch.sort(by_cell[is_first]).values[:beam]]


def passing_distance(state: Tensor, step: Transition) -> Tensor:
    """Return the distances [N] in metres at which states [N, 4] will pass the nearest target ship.

    Own ship is assumed to keep its course at full speed. Distances are clipped at 4/3 of the safe distance,
    and ships already past count as that far away.
    """
    away = step.away(state)
    max_distance = step.world.safe_distance * 4 / 3
    if not away.shape[1]:
        return torch.full_like(state[:, 0], max_distance)
    own_velocity = float(step.actions[:, 0].max()) * unit_vector(state[:, HEADING])
    velocity = step.ship_velocity - own_velocity[:, None]
    time = -(away * velocity).sum(-1) / (velocity * velocity).sum(-1).clamp(min=1e-6)
    distance = torch.linalg.vector_norm(away + time[..., None] * velocity, dim=-1)
    return torch.where(time > 0, distance, max_distance).amin(-1).clamp(max=max_distance)
