"""The best known return of a case: a beam search over action sequences.

The world is deterministic, so a sequence is a plan. What it finds is a lower bound of the best
return there is; results are compared with it, nothing is learned from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ship_trl.config import World
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import HEADING
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.transition import Transition

# One search over everything, then finer ones along the best plan so far. Plans that pass through
# one cell (metres, radians) at one time are alike, and only the best of them goes on; how far a
# plan may leave the one before (metres) keeps the finer searches near it.
PASSES = ((8.0, 0.05, math.inf), (5.0, 0.03, math.inf), (3.0, 0.02, 60.0), (1.5, 0.01, 30.0))


@dataclass(frozen=True)
class Plan:
    """The best sequence found: undiscounted raw return, actions, and whether it ends at the goal."""

    total: float
    actions: list[int]
    goal: bool


def best_plan(case: Case, world: World, beam: int = 5000) -> Plan:
    """Search for the action sequence of the greatest return; the same answer every time.

    Args:
        case: where to sail.
        world: physics and reward.
        beam: plans kept from one step to the next.
    """
    step = Transition(case, world, torch.device("cpu"))
    best = Plan(-math.inf, [], False)
    for metres, radians, width in PASSES:
        guide = positions(best.actions, step)
        found = search(step, beam, metres, radians, guide, width)
        best = max(best, found, key=lambda plan: plan.total)
    return best


def positions(actions: list[int], step: Transition) -> Tensor:
    """Where a plan leads: own ship after each action, [T, 2]."""
    state, places = step.start[None], []
    for action in actions:
        state = step(state, torch.tensor([action])).state
        places.append(state[0, :2])
    return torch.stack(places) if places else torch.zeros(0, 2)


def search(step: Transition, beam: int, metres: float, radians: float, guide: Tensor, width: float) -> Plan:
    """One beam search, within `width` of the `guide` [T, 2] (and free once that has ended)."""
    count = len(step.actions)
    state, total = step.start[None], torch.zeros(1, dtype=torch.float64)
    history = torch.zeros(1, 0, dtype=torch.int8)
    best = Plan(-math.inf, [], False)
    while len(state):
        action = torch.arange(count).repeat(len(state))
        parent = torch.arange(len(state)).repeat_interleave(count)
        after = step(state[parent], action)
        totals = total[parent] + after.reward
        ended = after.goal | after.collision | after.truncated
        if bool(ended.any()):
            first = int(totals.masked_fill(~ended, -math.inf).argmax())
            if float(totals[first]) > best.total:
                actions = [*history[parent[first]].tolist(), int(action[first])]
                best = Plan(float(totals[first]), actions, bool(after.goal[first]))
        hope = totals + optimistic_rest(after.state, step)
        lost = ended | (hope <= best.total)
        time = history.shape[1]
        if time < len(guide):
            lost |= torch.linalg.vector_norm(after.state[:, :2] - guide[time], dim=-1) > width
        kept = choose(hope.masked_fill(lost, -math.inf), after.state, beam, metres, radians)
        state, total = after.state[kept], totals[kept]
        history = torch.cat((history[parent[kept]], action[kept, None].to(torch.int8)), dim=1)
    return best


def optimistic_rest(state: Tensor, step: Transition) -> Tensor:
    """No less than any plan can still gain: straight to the goal at full speed, turning at once.

    Shape: [N, 4] to float64 [N].
    """
    world, weights = step.world, step.world.reward
    speed = float(step.actions[:, 0].max()) * world.dt
    turn = float(step.actions[:, 1].abs().max()) * world.dt
    distance = step.goal_distance(state).double()
    off_bow = angle_off_bow(state[:, :2], state[:, HEADING], step.goal).abs().double()
    count = ((distance - world.goal_distance) / speed).ceil().clamp(min=1.0)
    metres = count * distance - speed * count * (count + 1) / 2
    degrees = torch.rad2deg((off_bow - turn).clamp(min=0.0))
    return weights.w1 * weights.goal + weights.w3 * weights.k1 * metres + weights.w4 * weights.k2 * degrees


def choose(hope: Tensor, state: Tensor, beam: int, metres: float, radians: float) -> Tensor:
    """Indices of the most hopeful plans, one for each cell of place and heading."""
    order = torch.argsort(hope, descending=True, stable=True)
    order = order[: int(torch.isfinite(hope).sum())]
    near = state[order]
    place = torch.floor(near[:, :2] / metres).long()
    heading = torch.floor(near[:, HEADING] / radians).long()
    key = (place[:, 0] * 100_003 + place[:, 1]) * 100_003 + heading
    # A stable sort by cell leaves the most hopeful of each cell in front.
    by_cell = torch.argsort(key, stable=True)
    ordered = key[by_cell]
    leads = torch.ones(len(key), dtype=torch.bool)
    leads[1:] = ordered[1:] != ordered[:-1]
    return order[torch.sort(by_cell[leads]).values[:beam]]
