"""What held manoeuvres earn in training, as compiled loops: the values of an expert.

They are rollouts in the simulator itself: target ships hold course or give way as they really would
(recorded ships are taken to hold course). Tests compare them with the environment. A ship is a row of `SHIP`
numbers, which keeps what `fast.step` and `fast.track` would compute again in every step.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.types import Margin, World
from ship_trl.fast.jit import RELAXED, compiled
from ship_trl.fast.manoeuvres import steer_by
from ship_trl.fast.step import bearing_of, closest_approach, constants, must_give_way, step_reward
from ship_trl.fast.track import GIVE_WAY, HEAD_ON, NONE, Limits, action_of, begins_as, is_to_stand_on
from ship_trl.sim import state as col
from ship_trl.sim.cases import GIVES_WAY, GIVING_WAY
from ship_trl.sim.encounter import Tracker
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, PaidStep, reward_amounts
from ship_trl.sim.rules import COLLISION, GAINS, PASS, RADII, STAGE3, STAGE4

Array = np.ndarray[Any, Any]
# Own ship's place (m), heading (rad) and velocity (m/s).
Pose = tuple[float, float, float, float, float]
# Steps that a hardest turn is held, and steps straight on after it. They lie close: the rest of a manoeuvre
# must be nearly one of them.
HOLD, STRAIGHT = (*range(1, 13), 16), (0, 2, 5, 9, 14)
# Steps that straight on is held, and those that another action is.
WAIT, BRIEFLY = (*range(1, 13), 16, 20, 25), (1, 8)
# Behind a ship's numbers of a state: its velocity, and place and TCPA relative to own ship before a step.
VELOCITY_X, VELOCITY_Y, BEFORE_X, BEFORE_Y, BEFORE_TCPA = range(col.SHIP_SIZE, col.SHIP_SIZE + 5)
SHIP = col.SHIP_SIZE + 5
# Radians: nearer to the bow the goal counts as ahead.
AHEAD = 0.006
# Share of the speed: with more to gain, ships that fall behind may come nearer again.
SLOWED = 1e-3


@compiled(RELAXED)
def tcpa_of(x: float, y: float, velocity_x: float, velocity_y: float) -> float:
    """Return TCPA (s) for a relative place (m) and velocity (m/s)."""
    speed2 = velocity_x * velocity_x + velocity_y * velocity_y
    return -(x * velocity_x + y * velocity_y) / speed2 if speed2 > 0 else 0.0


@compiled(RELAXED)
def move(ship: Array, own: Pose, limits: Array) -> None:
    """Move a ship [SHIP] by a step, and write where it was relative to own ship: place, heading, velocity."""
    x, y, heading, own_x, own_y = own
    dt, tcpa, dcpa, turn = limits[0], limits[8], limits[9], limits[10]
    away_x, away_y = ship[col.SHIP_X] - x, ship[col.SHIP_Y] - y
    velocity_x, velocity_y = ship[VELOCITY_X] - own_x, ship[VELOCITY_Y] - own_y
    time = tcpa_of(away_x, away_y, velocity_x, velocity_y)
    ship[BEFORE_X], ship[BEFORE_Y], ship[BEFORE_TCPA] = away_x, away_y, time
    if ship[col.SHIP_BEHAVIOUR] in (GIVES_WAY, GIVING_WAY):
        is_near = math.hypot(away_x + time * velocity_x, away_y + time * velocity_y) < dcpa
        is_giving = time > 0 and ship[col.SHIP_BEHAVIOUR] == GIVING_WAY
        if time > 0 and is_near and time <= tcpa and not is_giving:
            bearing = bearing_of(-away_x, -away_y, ship[col.SHIP_HEADING])
            is_giving = must_give_way(bearing, bearing_of(away_x, away_y, heading))
        ship[col.SHIP_BEHAVIOUR] = GIVING_WAY if is_giving else GIVES_WAY
        if is_giving and is_near:
            course = ship[col.SHIP_HEADING] - turn
            ship[col.SHIP_HEADING] = course
            ship[VELOCITY_X] = ship[col.SHIP_SPEED] * math.cos(course)
            ship[VELOCITY_Y] = ship[col.SHIP_SPEED] * math.sin(course)
    ship[col.SHIP_X] += ship[VELOCITY_X] * dt
    ship[col.SHIP_Y] += ship[VELOCITY_Y] * dt


@compiled(RELAXED)
def lack_at_approach(ship: Array, x: float, y: float, heading: float, kind: int, safe: float) -> float:
    """Return what safety and side of a pass lack, as `sim.rules.rule_payment` counts them.

    The ship is now at (x, y) relative to own ship.
    """
    distance, ranged = closest_approach(ship[BEFORE_X], ship[BEFORE_Y], x, y), 0.0
    for k in range(3):
        low, high = RADII[k] * safe / COLLISION, RADII[k + 1] * safe / COLLISION
        ranged += GAINS[k] * min(max((distance - low) / (high - low), 0.0), 1.0)
    bearing, aspect = bearing_of(x, y, heading), bearing_of(-x, -y, ship[col.SHIP_HEADING])
    pose = 0.25 * min(1 - math.cos(aspect), 1.0) + 0.75 * min(1 - math.cos(bearing), 1.0)
    lack = 1 - (ranged + (1 - ranged) * pose) * (distance >= safe)
    if kind == HEAD_ON:
        port = (math.sin(aspect) - 1) / 2 * (math.sin(bearing) - 1) / 2
        return lack + 0.6 * (1 - port * port)
    degrees = math.degrees(aspect)
    if kind == GIVE_WAY:
        return lack + 0.5 * (-25 < degrees < 165)
    return lack + 0.3 * (abs(degrees) < 45)


@compiled(RELAXED)
def pay(ship: Array, own: Pose, slowed: float, safe: float, limits: Limits) -> tuple[float, bool]:
    """Track a ship [SHIP] after a step; return what the step earns, and whether the ship comes nearer."""
    x, y, heading, own_x, own_y = own
    away_x, away_y = ship[col.SHIP_X] - x, ship[col.SHIP_Y] - y
    velocity_x, velocity_y = ship[VELOCITY_X] - own_x, ship[VELOCITY_Y] - own_y
    time = tcpa_of(away_x, away_y, velocity_x, velocity_y)
    had, paid = int(ship[col.SHIP_CLASS]), 0.0
    kind = had
    if had != NONE and time < 0 and math.hypot(away_x, away_y) > limits[2]:
        kind = NONE
    if kind == NONE:
        kind = begins_as(
            (away_x, away_y, velocity_x, velocity_y),
            time,
            heading,
            ship[col.SHIP_HEADING],
            ship[col.SHIP_SPEED],
            limits,
        )
        if kind != NONE:
            ship[col.SHIP_CLASS], ship[col.SHIP_ONSET_HEADING], ship[col.SHIP_ACTION] = kind, heading, 0.0
            return 0.0, True
    acted = 0.0
    if kind != NONE:
        action = max(ship[col.SHIP_ACTION], action_of(kind, ship[col.SHIP_ONSET_HEADING] - heading, slowed))
        acted, ship[col.SHIP_ACTION] = action - ship[col.SHIP_ACTION], action
    ship[col.SHIP_CLASS] = kind
    if had != NONE:
        distance = math.hypot(ship[BEFORE_X], ship[BEFORE_Y])
        if is_to_stand_on(had):
            paid -= acted * (distance > STAGE4)
        elif ship[BEFORE_TCPA] > 0:
            paid += acted * min(distance / STAGE3, 1.0)
            if time <= 0:
                paid -= PASS * lack_at_approach(ship, away_x, away_y, heading, had, safe)
    return paid, time > 0


@compiled(RELAXED)
def wrapped(angle: float) -> float:
    """Return an angle (rad) in [-pi, pi)."""
    return angle - 2 * math.pi * math.floor((angle + math.pi) / (2 * math.pi))


@compiled(RELAXED)
def meet(ships: Array, before: Pose, x: float, y: float, limits: Array) -> float:
    """Move all ships [K, SHIP], and return the least distance (m) to own ship, which goes to (x, y)."""
    nearest = MAX_SHIP_DISTANCE
    for k in range(ships.shape[0]):
        ship = ships[k]
        move(ship, before, limits)
        passed = closest_approach(ship[BEFORE_X], ship[BEFORE_Y], ship[col.SHIP_X] - x, ship[col.SHIP_Y] - y)
        nearest = min(nearest, passed)
    return nearest


@compiled(RELAXED)
def pay_all(ships: Array, own: Pose, slowed: float, safe: float, limits: Limits) -> tuple[float, bool]:
    """Return the mean of what a step earns by all ships [K, SHIP], and whether any comes nearer."""
    paid, nearing = 0.0, False
    for k in range(ships.shape[0]):
        more, is_nearing = pay(ships[k], own, slowed, safe, limits)
        paid += more / ships.shape[0]
        nearing |= is_nearing
    return paid, nearing


class Training(NamedTuple):
    """What manoeuvres are followed in, and paid by.

    Attributes:
        actions: speed (m/s) and rate of turn (rad/s) of each action [A, 2].
        straight: the action that goes straight on.
        limits: those of `fast.step.constants`.
        amounts: those of the world's rewards.
        extra: distance, penalty, rules and collision of the margin.
        tracked: speed of going straight, and when an encounter begins and ends.
    """

    actions: Array
    straight: int
    limits: Array
    amounts: tuple[float, ...]
    extra: tuple[float, float, float, float]
    tracked: tuple[float, tuple[float, ...]]


@compiled(RELAXED)
def follow(row: Array, plan: Array, ships: Array, training: Training) -> tuple[int, float]:
    """Return the first action of a manoeuvre [3] from a state [S], and what the manoeuvre earns.

    `ships` [K, SHIP] are the target ships, and are moved.
    """
    actions, straight, limits, amounts, extra, tracked = training
    dt, safe, to_goal, max_steps = limits[:4]
    left_speed, left_turn, mean_speed, mean_turn = limits[4:8]
    margin, penalty, rules, sunk = extra
    width = max(margin - safe, np.float32(1e-6))
    x, y, heading, speed, yaw = row[col.X], row[col.Y], row[col.HEADING], row[col.SPEED], row[col.YAW_RATE]
    cos, sin = math.cos(heading), math.sin(heading)
    off = wrapped(math.atan2(row[col.GOAL_Y] - y, row[col.GOAL_X] - x) - heading)
    first, total, nearing = -1, 0.0, True
    hold, wait = plan[1], plan[2]
    for _ in range(int(max_steps - row[col.STEP])):
        if hold > 0:
            action, hold = plan[0], hold - 1
        elif wait > 0:
            action, wait = straight, wait - 1
        else:
            action = steer_by(off, actions, dt)
        if first < 0:
            first = action
        now = x, y, heading, speed * cos, speed * sin
        wanted, turn = actions[action, 0], actions[action, 1]
        speed_lag, turn_lag = speed - wanted, yaw - turn
        heading += (turn + turn_lag * mean_turn) * dt
        cos, sin = math.cos(heading), math.sin(heading)
        way = (wanted + speed_lag * mean_speed) * dt
        speed, yaw = wanted + speed_lag * left_speed, turn + turn_lag * left_turn
        x, y = x + way * cos, y + way * sin
        # Behind the last ship that comes nearer, and straight for the goal, nothing more is paid for ships.
        nearest = meet(ships, now, x, y, limits) if nearing else MAX_SHIP_DISTANCE
        east, north = row[col.GOAL_X] - x, row[col.GOAL_Y] - y
        distance = math.hypot(east, north)
        off = wrapped(math.atan2(north, east) - heading)
        collided = nearest < safe
        reached = distance <= to_goal and not collided
        paid = PaidStep(distance, off, np.float64(reached), np.float64(collided), nearest, wanted, turn)
        earned = step_reward(amounts, paid)
        if penalty > 0:
            earned -= penalty * min(max((margin - nearest) / width, 0.0), 1.0)
        if collided:
            earned -= sunk
        if nearing:
            slowed = abs(speed / tracked[0] - 1)
            now = x, y, heading, speed * cos, speed * sin
            more, is_nearing = pay_all(ships, now, slowed, safe, tracked[1])
            earned += rules * more
            is_turning = hold + wait > 0 or abs(off) > AHEAD or abs(yaw) > 0
            nearing = is_nearing or is_turning or slowed > SLOWED
        total += earned
        if reached or collided:
            break
    return first, total


@compiled(RELAXED)
def plan_values(states: Array, table: Array, training: Training, values: Array) -> None:
    """Write into `values` [N, A] what the best manoeuvre that begins with each action earns.

    `states` are float32 [N, S], and `table` has the manoeuvres, int64 [P, 3].
    """
    places = (states.shape[1] - col.OWN_SIZE) // col.SHIP_SIZE
    ships, moved = np.empty((places, SHIP)), np.empty((places, SHIP))
    for n in range(states.shape[0]):
        row, count = states[n], int(states[n, col.SHIP_COUNT])
        for k in range(count):
            for i in range(col.SHIP_SIZE):
                ships[k, i] = row[col.OWN_SIZE + col.SHIP_SIZE * k + i]
            ships[k, VELOCITY_X] = ships[k, col.SHIP_SPEED] * math.cos(ships[k, col.SHIP_HEADING])
            ships[k, VELOCITY_Y] = ships[k, col.SHIP_SPEED] * math.sin(ships[k, col.SHIP_HEADING])
        values[n] = -np.inf
        for p in range(table.shape[0]):
            moved[:count] = ships[:count]
            first, total = follow(row, table[p], moved[:count], training)
            values[n, first] = max(values[n, first], total)


class PlanValues:
    """What the best held manoeuvre earns that begins with each action: `values(states)`, [N, S] to [N, A].

    A manoeuvre holds an action, goes straight on, and then steers for the goal. It is followed in the
    simulator to its end, and paid as training pays, with its margin.

    Args:
        world: physics and reward.
        margin: what training adds to the reward.
        scale: factor of the values.

    Attributes:
        table: the manoeuvres, as in `policies.manoeuvres`, int64 [P, 3].
    """

    def __init__(self, world: World, margin: Margin, scale: float = 1.0) -> None:
        straight, tracker = world.straight_action, Tracker(world)
        hardest = max(abs(turn) for _, turn in world.actions)
        table = [(straight, hold, 0) for hold in WAIT]
        for action, (_, turn) in enumerate(world.actions):
            if action != straight:
                holds, waits = (HOLD, STRAIGHT) if abs(turn) == hardest else (BRIEFLY, (0,))
                table += product([action], holds, waits)
        self.table, self._scale, self._count = torch.tensor(table), scale, len(world.actions)
        self._training = Training(
            np.array(world.actions, np.float64),
            straight,
            constants(world).astype(np.float64),
            reward_amounts(world.reward),
            (margin.distance, margin.penalty, margin.rules, margin.collision),
            (float(tracker.cruise), tuple(map(float, tracker.limits))),
        )

    def __call__(self, states: Tensor) -> Tensor:
        """Return the values of states [N, S]: float32 [N, A], scaled."""
        return self.of_plans(states, self.table)

    def of_plans(self, states: Tensor, plans: Tensor) -> Tensor:
        """Return the values if there are only these manoeuvres, int64 [P, 3]; minus infinity without one."""
        values = np.empty((len(states), self._count), np.float32)
        plan_values(states.contiguous().numpy(), plans.numpy(), self._training, values)
        return torch.from_numpy(values) * self._scale
