"""What held manoeuvres of `policies.manoeuvres` lead to, as compiled loops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ship_trl.fast.jit import compiled
from ship_trl.fast.step import closest_approach, give_way
from ship_trl.sim import state as col
from ship_trl.sim.cases import GIVES_WAY, GIVING_WAY

Array = np.ndarray[Any, Any]
# All manoeuvres, int64 [P, 3]; speed (m/s) and rate of turn (rad/s) of each action [A, 2]; the constants of
# `fast.step`; and the action that goes straight on.
Model = tuple[Array, Array, Array, int]
# Steps: longer than any episode.
FOREVER = 1 << 30


@compiled()
def steer(row: Array, actions: Array, dt: float) -> int:
    """Return the action whose turn brings the bow nearest to the goal in a state [S]."""
    off = math.atan2(row[col.GOAL_Y] - row[col.Y], row[col.GOAL_X] - row[col.X]) - row[col.HEADING]
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
    ship, way = row[place:], row[place + col.SHIP_SPEED] * dt
    is_giving = ship[col.SHIP_BEHAVIOUR] == GIVING_WAY
    if not is_giving:
        east, north = way * math.cos(ship[col.SHIP_HEADING]), way * math.sin(ship[col.SHIP_HEADING])
        x, y = ship[col.SHIP_X] + t * east, ship[col.SHIP_Y] + t * north
        if closest_approach(x - now[col.X], y - now[col.Y], x + east - new[0], y + north - new[1]) < safe:
            return False
    if not (is_giving or reacting):
        return True
    ship = now[place:]
    course, behaviour = give_way(now, place, tcpa, dcpa, rule_turn)
    x, y = ship[col.SHIP_X], ship[col.SHIP_Y]
    east, north = way * math.cos(course), way * math.sin(course)
    ship[col.SHIP_X], ship[col.SHIP_Y], ship[col.SHIP_HEADING], ship[col.SHIP_BEHAVIOUR] = (
        x + east,
        y + north,
        course,
        behaviour,
    )
    nearest = closest_approach(x - now[col.X], y - now[col.Y], x + east - new[0], y + north - new[1])
    return bool(nearest >= safe)


@compiled()
def arrives(
    row: Array, first: int, plan: Array, model: Model, reacting: bool, horizon: int = FOREVER
) -> bool:
    """Return whether an action and then a manoeuvre [3] reach the goal in time, clear of target ships.

    Args:
        row: a state [S].
        first: the action.
        plan: the manoeuvre.
        model: own ship's actions and constants.
        reacting: whether to keep clear of ships that hold course also if they give way.
        horizon: steps after which it is enough to be clear.
    """
    _, actions, constants, straight = model
    dt, _, goal_distance, max_steps = constants[:4]
    left_speed, left_turn, mean_speed, mean_turn = constants[4:8]
    now = row.copy()
    for k in range(int(row[col.SHIP_COUNT])):
        behaviour = col.OWN_SIZE + col.SHIP_SIZE * k + col.SHIP_BEHAVIOUR
        now[behaviour] = max(now[behaviour], GIVES_WAY)
    left = int(max_steps - row[col.STEP])
    for t in range(min(horizon, left)):
        if t == 0:
            action = first
        elif t <= plan[1]:
            action = plan[0]
        elif t <= plan[1] + plan[2]:
            action = straight
        else:
            action = steer(now, actions, dt)
        speed, turn = actions[action, 0], actions[action, 1]
        speed_lag, turn_lag = now[col.SPEED] - speed, now[col.YAW_RATE] - turn
        heading = now[col.HEADING] + (turn + turn_lag * mean_turn) * dt
        way = (speed + speed_lag * mean_speed) * dt
        new = now[col.X] + way * math.cos(heading), now[col.Y] + way * math.sin(heading)
        for k in range(int(row[col.SHIP_COUNT])):
            if not keeps_clear(row, now, t, col.OWN_SIZE + col.SHIP_SIZE * k, new, constants, reacting):
                return False
        now[col.X], now[col.Y], now[col.HEADING] = new[0], new[1], heading
        now[col.SPEED], now[col.YAW_RATE] = speed + speed_lag * left_speed, turn + turn_lag * left_turn
        if math.hypot(row[col.GOAL_X] - new[0], row[col.GOAL_Y] - new[1]) <= goal_distance:
            return True
    return horizon <= left


@compiled()
def stay_clear(state: Array, allowed: Array, model: Model, horizon: int, found: Array) -> None:
    """Write into `found` [N] whether an allowed action, bool [N, A], keeps clear of ships that hold course.

    One is enough, with one of the manoeuvres after it, for `horizon` steps or to the end.
    """
    table, _, constants, _ = model
    for n in range(state.shape[0]):
        row, found[n] = state[n], False
        steps = min(horizon, int(constants[3] - row[col.STEP]))
        for p in range(table.shape[0]):
            for a in range(allowed.shape[1]):
                if allowed[n, a] and arrives(row, a, table[p], model, False, steps):
                    found[n] = True
                    break
            if found[n]:
                break


@compiled()
def begin(row: Array, plan: Array, model: Model, rest: Array) -> int:
    """Return the action with which a manoeuvre [3] begins in a state [S]; write what is left into `rest`."""
    rest[0], rest[1], rest[2] = plan[0], max(0, plan[1] - 1), plan[2]
    if plan[1] > 0:
        return plan[0]
    rest[2] = max(0, plan[2] - 1)
    _, actions, constants, straight = model
    return straight if plan[2] > 0 else steer(row, actions, constants[0])


@compiled()
def choose_actions(state: Array, order: Array, model: Model, plans: Array, chosen: Array) -> None:
    """Write what `Manoeuvres.choose` returns into `plans` [N, 3] and `chosen` [N]."""
    table = model[0]
    count = len(table)
    # The plan found last and all manoeuvres from now on, by their first action; then all behind an action.
    first, rest = np.empty(count + 1, np.int64), np.empty((2 * count + 1, 3), np.int64)
    rest[count + 1 :] = table
    for n in range(state.shape[0]):
        row = state[n]
        for p in range(count + 1):
            plan = table[p - 1] if p else plans[n]
            first[p] = begin(row, plan, model, rest[p])
        chosen[n], had_plan = -1, plans[n, 0] >= 0
        # First clear of ships that may give way, else of ships that hold course.
        for reacting in (True, False):
            for a in order[n]:
                for p in range(1 - had_plan, 2 * count + 1):
                    fits = p > count or first[p] == a
                    if fits and arrives(row, a, rest[p], model, reacting):
                        chosen[n], plans[n] = a, rest[p]
                        break
                if chosen[n] >= 0:
                    break
            if chosen[n] >= 0:
                break
        if chosen[n] < 0 and had_plan:
            chosen[n], plans[n] = first[0], rest[0]
