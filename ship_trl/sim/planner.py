"""The best known return of a case: beam searches over action sequences.

The world is deterministic, so a sequence is a plan. What it finds is a lower bound of the best
return there is; results are compared with it, nothing is learned from it.
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


class Pass(NamedTuple):
    """One beam search.

    Plans alike in place (m), heading (rad) and passing distance (m) at one time share a cell, and
    only the best of a cell goes on. None goes farther than `width` (m) from the best plan so far.
    """

    metres: float
    radians: float
    passing: float
    width: float


# One search over everything, then finer ones along the best plan so far.
PASSES = (Pass(8.0, 0.05, 1.0, math.inf), Pass(4.0, 0.03, 1.0, 40.0), Pass(2.0, 0.02, 0.5, 20.0))
# A plan that would pass too near is ranked as if each missing metre cost so many metres of
# distance for one second; without that, plans bound to collide crowd out those that give way.
DETOUR = 50.0


@dataclass(frozen=True)
class Plan:
    """The best sequence found: undiscounted raw return, actions, and whether it ends at the goal."""

    episode_return: float
    actions: list[int]
    goal: bool


def best_plan(case: Case, world: World, beam: int = 6000) -> Plan:
    """Search for the action sequence of the greatest return; the same answer every time.

    Where no sequence found reaches the goal, the plan is the best of those that do not.

    Args:
        case: where to sail.
        world: physics and reward.
        beam: plans kept from one step to the next.
    """
    step = Transition(case, world, torch.device("cpu"))
    value_bound = ValueBound(step)
    best = Plan(-math.inf, [], False)
    for fineness in PASSES:
        best = search(step, value_bound, beam, fineness, best)
    return best


def search(step: Transition, value_bound: ValueBound, beam: int, fineness: Pass, best: Plan) -> Plan:
    """One beam search; returns `best` where it finds nothing better."""
    guide = positions(step, best.actions)
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
        hope = totals + value_bound(after.state)
        going = ~ended & (hope > best.episode_return - value_bound.doubt)
        time = history.shape[1]
        if time < len(guide):
            going &= torch.linalg.vector_norm(after.state[:, :2] - guide[time], dim=-1) <= fineness.width
        rows = going.nonzero().squeeze(-1)
        rows = rows[choose(hope[rows], after.state[rows], step, beam, fineness)]
        state, total = after.state[rows], totals[rows]
        history = torch.cat((history[parent[rows]], action[rows, None].to(torch.int8)), dim=1)
    return best


def positions(step: Transition, actions: list[int]) -> Tensor:
    """Where a plan leads: own ship after each action, [T, 2]."""
    state, places = step.start[None], [torch.zeros(0, 2)]
    for action in actions:
        state = step(state, torch.tensor([action])).state
        places.append(state[:, :2])
    return torch.cat(places)


def choose(hope: Tensor, state: Tensor, step: Transition, beam: int, fineness: Pass) -> Tensor:
    """Choose the most hopeful plans, one for each cell; returns their indices."""
    passing = passing_distance(state, step)
    weights, safe = step.world.reward, step.world.safe_distance
    metre = abs(weights.w3 * weights.k1) * DETOUR
    order = torch.argsort(hope - metre * (safe - passing).clamp(min=0.0), descending=True, stable=True)
    cells = torch.cat(
        (
            state[:, :2] / fineness.metres,
            state[:, HEADING, None] / fineness.radians,
            passing[:, None] / fineness.passing,
        ),
        dim=-1,
    )
    key = torch.zeros(len(state), dtype=torch.long)
    for column in cells[order].floor().long().unbind(-1):
        key = key * 10_007 + column
    # A stable sort by cell leaves the most hopeful of each cell in front.
    by_cell = torch.argsort(key, stable=True)
    ordered = key[by_cell]
    leads = torch.ones(len(key), dtype=torch.bool)
    leads[1:] = ordered[1:] != ordered[:-1]
    return order[torch.sort(by_cell[leads]).values[:beam]]


def passing_distance(state: Tensor, step: Transition) -> Tensor:
    """Least distance (m) to any target ship ahead in time, keeping course at full speed: [N, 4] to [N].

    Distances of no concern, and ships already past, count as a third more than the safe distance.
    """
    away = step.away(state)
    harmless = step.world.safe_distance * 4 / 3
    if not away.shape[1]:
        return torch.full_like(state[:, 0], harmless)
    own = float(step.actions[:, 0].max()) * unit_vector(state[:, HEADING])
    drift = step.ship_velocity - own[:, None]
    time = -(away * drift).sum(-1) / (drift * drift).sum(-1).clamp(min=1e-6)
    distance = torch.linalg.vector_norm(away + time[..., None] * drift, dim=-1)
    return torch.where(time > 0, distance, harmless).amin(-1).clamp(max=harmless)
