"""Held manoeuvres: an action for some steps, straight on for some, then a course for the goal.

The generator of random encounters keeps only scenes that one of these solves, if target ships hold their
course (`sim.starts`). So policy `manoeuvre`, which follows the best of them, solves all these scenes by
construction: it is a bar for other policies, not a finding.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.jit import compiled
from ship_trl.fast.step import closest_approach, constants, give_way
from ship_trl.sim.cases import GIVES_WAY, GIVING_WAY, HOLDS_COURSE
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.reward import POSITION_TOLERANCE
from ship_trl.sim.starts import HOLD, STRAIGHT
from ship_trl.sim.state import (
    GOAL_X,
    GOAL_Y,
    HEADING,
    OWN_SIZE,
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SIZE,
    SHIP_SPEED,
    SHIP_X,
    SHIP_Y,
    SPEED,
    STEP,
    YAW_RATE,
    X,
    Y,
    goal_off_bow,
    target_ships,
)
from ship_trl.sim.transition import Transition

Array = NDArray[Any]


def manoeuvre_table(world: World) -> Array:
    """Return all manoeuvres, int64 [P, 3]: an action, steps that it is held, and steps straight on after it.

    The first one steers for the goal at once.
    """
    straight = world.straight_action
    evading = [k for k in range(len(world.actions)) if k != straight]
    return np.array(
        [(straight, 0, 0), *((a, h, s) for s, h, a in product(STRAIGHT, HOLD, evading))], np.int64
    )


class Manoeuvres:
    """The manoeuvres of a world, and what they lead to if target ships hold course and speed."""

    def __init__(self, world: World) -> None:
        self.world, self.table = world, manoeuvre_table(world)
        self.actions = np.array(world.actions, np.float64)
        self.constants = constants(world).astype(np.float64)
        # Float32 states may differ from these float64 ones.
        self.constants[1] += POSITION_TOLERANCE

    def follow(self, state: Tensor, plans: Tensor) -> tuple[Tensor, Tensor]:
        """Return the first actions [N] of plans [N, 3] in states [N, S], and what is left of the plans."""
        action, hold, straight = plans.unbind(-1)
        turns = torch.tensor(self.actions[:, 1] * self.world.dt, dtype=state.dtype, device=state.device)
        steering = (goal_off_bow(state)[:, None] - turns).abs().argmin(-1)
        chosen = torch.where(straight > 0, self.world.straight_action, steering)
        chosen = torch.where(hold > 0, action, chosen)
        left = torch.stack(
            (action, (hold - 1).clamp(min=0), torch.where(hold > 0, straight, straight - 1)), -1
        )
        return chosen, left.clamp(min=0)

    def choose(self, state: Tensor, order: Tensor, plans: Tensor) -> tuple[Tensor, Tensor]:
        """Return for each row the first action with which a way to the goal begins, or -1; and its rest.

        Args:
            state: states [N, S].
            order: actions, the wanted ones first, int64 [N, A].
            plans: of each row the manoeuvre found last, int64 [N, 3], -1 without one. It is tried before the
                others, and goes on where none is found: by rounding it may pass or arrive too late.
        """
        chosen, found = np.empty(len(state), np.int64), plans.numpy().copy()
        rows, straight = state.double().numpy(), self.world.straight_action
        table = self.table, self.actions, self.constants, straight
        choose_actions(rows, order.numpy(), *table, found, chosen)
        return torch.from_numpy(chosen), torch.from_numpy(found)


@compiled()
def steer(row: Array, actions: Array, dt: float) -> int:
    """Return the action whose turn brings the bow nearest to the goal in a state [S]."""
    off = math.atan2(row[GOAL_Y] - row[Y], row[GOAL_X] - row[X]) - row[HEADING]
    off -= 2 * math.pi * math.floor((off + math.pi) / (2 * math.pi))
    best = 0
    for k in range(actions.shape[0]):
        if abs(off - actions[k, 1] * dt) < abs(off - actions[best, 1] * dt):
            best = k
    return best


@compiled()
def keeps_clear(
    row: Array, now: Array, t: int, place: int, new: tuple[float, float], constants: Array, reacting: bool
) -> bool:
    """Return whether own ship's step from `now` to a place keeps clear of a ship; move the ship in `now`.

    A ship that is giving way goes on. Another one holds course; if `reacting`, own ship must also keep clear
    of it if it gives way. `row` [S] is the state `t` steps ago, `now` [S] has ships that give way, `place` is
    where the ship's numbers begin.
    """
    dt, safe = constants[:2]
    tcpa, dcpa, rule_turn = constants[8:]
    ship, way = row[place:], row[place + SHIP_SPEED] * dt
    is_giving = ship[SHIP_BEHAVIOUR] == GIVING_WAY
    if not is_giving:
        east, north = way * math.cos(ship[SHIP_HEADING]), way * math.sin(ship[SHIP_HEADING])
        x, y = ship[SHIP_X] + t * east, ship[SHIP_Y] + t * north
        if closest_approach(x - now[X], y - now[Y], x + east - new[0], y + north - new[1]) < safe:
            return False
    if not (is_giving or reacting):
        return True
    ship = now[place:]
    course, behaviour = give_way(now, place, tcpa, dcpa, rule_turn)
    x, y = ship[SHIP_X], ship[SHIP_Y]
    east, north = way * math.cos(course), way * math.sin(course)
    ship[SHIP_X], ship[SHIP_Y], ship[SHIP_HEADING], ship[SHIP_BEHAVIOUR] = (
        x + east,
        y + north,
        course,
        behaviour,
    )
    nearest = closest_approach(x - now[X], y - now[Y], x + east - new[0], y + north - new[1])
    return bool(nearest >= safe)


@compiled()
def arrives(
    row: Array, first: int, plan: Array, actions: Array, constants: Array, straight: int, reacting: bool
) -> bool:
    """Return whether an action and then a manoeuvre [3] reach the goal in time, clear of target ships.

    Args:
        row: a state [S].
        first: the action.
        plan: the manoeuvre.
        actions: speed (m/s) and rate of turn (rad/s) of each action [A, 2].
        constants: those of `fast.step`.
        straight: the action that goes straight on.
        reacting: whether to keep clear of ships that hold course also if they give way.
    """
    dt, _, goal_distance, max_steps = constants[:4]
    left_speed, left_turn, mean_speed, mean_turn = constants[4:8]
    now = row.copy()
    for k in range(int(row[SHIP_COUNT])):
        behaviour = OWN_SIZE + SHIP_SIZE * k + SHIP_BEHAVIOUR
        now[behaviour] = max(now[behaviour], GIVES_WAY)
    for t in range(int(max_steps - row[STEP])):
        if t == 0:
            action = first
        elif t <= plan[1]:
            action = plan[0]
        elif t <= plan[1] + plan[2]:
            action = straight
        else:
            action = steer(now, actions, dt)
        speed, turn = actions[action, 0], actions[action, 1]
        speed_lag, turn_lag = now[SPEED] - speed, now[YAW_RATE] - turn
        heading = now[HEADING] + (turn + turn_lag * mean_turn) * dt
        way = (speed + speed_lag * mean_speed) * dt
        new = now[X] + way * math.cos(heading), now[Y] + way * math.sin(heading)
        for k in range(int(row[SHIP_COUNT])):
            if not keeps_clear(row, now, t, OWN_SIZE + SHIP_SIZE * k, new, constants, reacting):
                return False
        now[X], now[Y], now[HEADING] = new[0], new[1], heading
        now[SPEED], now[YAW_RATE] = speed + speed_lag * left_speed, turn + turn_lag * left_turn
        if math.hypot(row[GOAL_X] - new[0], row[GOAL_Y] - new[1]) <= goal_distance:
            return True
    return False


@compiled()
def begin(row: Array, plan: Array, actions: Array, dt: float, straight: int, rest: Array) -> int:
    """Return the action with which a manoeuvre [3] begins in a state [S]; write what is left into `rest`."""
    rest[0], rest[1], rest[2] = plan[0], max(0, plan[1] - 1), plan[2]
    if plan[1] > 0:
        return plan[0]
    rest[2] = max(0, plan[2] - 1)
    return straight if plan[2] > 0 else steer(row, actions, dt)


@compiled()
def choose_actions(
    state: Array,
    order: Array,
    table: Array,
    actions: Array,
    constants: Array,
    straight: int,
    plans: Array,
    chosen: Array,
) -> None:
    """Write what `Manoeuvres.choose` returns into `plans` [N, 3] and `chosen` [N]."""
    count = len(table)
    # The plan found last and all manoeuvres from now on, by their first action; then all behind an action.
    first, rest = np.empty(count + 1, np.int64), np.empty((2 * count + 1, 3), np.int64)
    rest[count + 1 :] = table
    for n in range(state.shape[0]):
        row = state[n]
        for p in range(count + 1):
            plan = table[p - 1] if p else plans[n]
            first[p] = begin(row, plan, actions, constants[0], straight, rest[p])
        chosen[n], had_plan = -1, plans[n, 0] >= 0
        # Best clear of ships whatever they do.
        for reacting in (True, False):
            for a in order[n]:
                for p in range(1 - had_plan, 2 * count + 1):
                    fits = p > count or first[p] == a
                    if fits and arrives(row, a, rest[p], actions, constants, straight, reacting):
                        chosen[n], plans[n] = a, rest[p]
                        break
                if chosen[n] >= 0:
                    break
            if chosen[n] >= 0:
                break
        if chosen[n] < 0 and had_plan:
            chosen[n], plans[n] = first[0], rest[0]


class BestManoeuvre:
    """Follows, of all manoeuvres from the start, the one with the highest return or the best rule scores.

    It is chosen once, at step 0, as if target ships held course.

    Args:
        env: where it acts.
        by_rules: whether the mean rule score counts first; only manoeuvres that reach the goal then count.
    """

    def __init__(self, env: ShipEnv, by_rules: bool = False) -> None:
        self.manoeuvres, self.by_rules = Manoeuvres(env.world), by_rules
        self.plans = torch.empty(0, 3, dtype=torch.int64)

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        state = step["state"]
        if len(self.plans) != len(state):
            self.plans = torch.zeros(len(state), 3, dtype=torch.int64)
        for n in (state[:, STEP] == 0).nonzero().squeeze(-1).tolist():
            self.plans[n] = self.best(state[n])
        action, self.plans = self.manoeuvres.follow(state, self.plans)
        return step.set("action", action)

    def best(self, start: Tensor) -> Tensor:
        """Return the best manoeuvre [3] from a state [S]."""
        world, plans = self.manoeuvres.world, torch.from_numpy(self.manoeuvres.table)
        transition, state = Transition(world), start.repeat(len(plans), 1)
        target_ships(state)[..., SHIP_BEHAVIOUR] = HOLDS_COURSE
        table, states = plans, [state]
        total, running = torch.zeros(len(plans)), torch.ones(len(plans), dtype=torch.bool)
        arrives, last = torch.zeros_like(running), torch.zeros(len(plans), dtype=torch.int64)
        while bool(running.any()):
            action, plans = self.manoeuvres.follow(state, plans)
            after = transition(state, action)
            total += after.reward * running
            last += running
            arrives |= running & after.goal
            running = running & ~(after.goal | after.collision | after.truncated)
            state = after.state
            states.append(state)
        worth = total.double()
        if self.by_rules:
            from ship_trl.policies.metrics import score_rules

            scores = score_rules(torch.stack(states, 1), last, world).rules.flatten(1).nanmean(-1)
            # A return is at most some hundred points.
            worth = worth + 1e4 * scores.nan_to_num(1.0) + 1e6 * arrives
        return table[int(worth.argmax())]


def best_return(env: ShipEnv, _: int = 0) -> BestManoeuvre:
    """Return the policy that follows the manoeuvre with the highest return."""
    return BestManoeuvre(env)


def best_rules(env: ShipEnv, _: int = 0) -> BestManoeuvre:
    """Return the policy that follows the manoeuvre with the best rule scores of those that arrive."""
    return BestManoeuvre(env, by_rules=True)
