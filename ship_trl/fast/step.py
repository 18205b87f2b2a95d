"""`sim.transition.Transition` and `sim.starts.draw_scenes` as compiled loops; tests compare them.

It avoids torch's overhead per operator, which dominates in small batches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numba import float32
from numba.extending import register_jitable
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.jit import RELAXED, Loop, compiled
from ship_trl.sim import encounter, starts
from ship_trl.sim import state as col
from ship_trl.sim.cases import GIVES_WAY, GIVING_WAY
from ship_trl.sim.reward import MAX_SHIP_DISTANCE, POSITION_TOLERANCE, TERMS, PaidStep
from ship_trl.sim.transition import Outcome, Transition, lag_shares

Array = np.ndarray[Any, Any]
# float32 in compiled code; the types of Python and NumPy differ there.
Number = Any

# A Python float would turn every sum into float64.
ONE, ZERO = np.float32(1.0), np.float32(0.0)

for shared in (encounter.meets, encounter.crosses, encounter.overtakes, encounter.classify):
    register_jitable(fastmath=RELAXED)(shared)
DRAWING: tuple[Loop, ...] = (
    starts.uniform,
    starts.draw_ship,
    starts.keeps_clear,
    starts.draw_ships,
    starts.is_solvable,
)
for loop in DRAWING:
    register_jitable(fastmath=RELAXED, error_model="numpy")(loop)
draw_scenes = compiled(RELAXED)(starts.draw_scenes)
bearing_of = register_jitable(fastmath=RELAXED)(encounter.bearing_of)
must_give_way = register_jitable(fastmath=RELAXED)(encounter.must_give_way)


def sum_of(formulas: list[Callable[..., Number]]) -> Callable[..., Number]:
    """Return the sum of the rewards' formulas as a function of their amounts and a `PaidStep`."""
    *others, formula = map(register_jitable(fastmath=RELAXED), formulas)
    last = len(others)
    if not others:
        return register_jitable(fastmath=RELAXED)(lambda amounts, step: formula(amounts[0], step))
    before = sum_of(others)

    def total(amounts: tuple[Number, ...], step: PaidStep) -> Number:
        return before(amounts, step) + formula(amounts[last], step)

    return register_jitable(fastmath=RELAXED)(total)


step_reward = sum_of([term.formula for term in TERMS.values()])


def constants(world: World) -> Array:
    """Return the constants of `step`, float32 [11].

    dt (s), safe distance (m), goal distance (m), maximum of steps; what lags leave of speed and rate of turn
    at the end of a step, and as the mean over it; TCPA (s), DCPA (m) and turn of a step (rad) of the rule.
    """
    to_goal, rule = world.goal_distance + POSITION_TOLERANCE, world.give_way
    limits = world.dt, world.safe_distance, to_goal, world.max_steps
    left, mean = lag_shares(world)
    return np.asarray((*limits, *left, *mean, rule.tcpa, rule.dcpa, rule.turn * world.dt), np.float32)


@compiled(RELAXED)
def give_way(row: Array, ship: int, tcpa: Number, dcpa: Number, turn: Number) -> tuple[Number, Number]:
    """Return heading and behaviour of a reacting ship after its turn, as `transition.give_way` computes them.

    `row` [S] is a state, in which the ship's numbers begin at `ship`; the rest is of `constants`.
    """
    course, speed = row[ship + col.SHIP_HEADING], row[ship + col.SHIP_SPEED]
    away_x, away_y = row[ship + col.SHIP_X] - row[col.X], row[ship + col.SHIP_Y] - row[col.Y]
    velocity_x = speed * math.cos(course) - row[col.SPEED] * math.cos(row[col.HEADING])
    velocity_y = speed * math.sin(course) - row[col.SPEED] * math.sin(row[col.HEADING])
    speed2 = velocity_x * velocity_x + velocity_y * velocity_y
    time = -(away_x * velocity_x + away_y * velocity_y) / speed2 if speed2 > 0 else ZERO
    is_near = math.hypot(away_x + time * velocity_x, away_y + time * velocity_y) < dcpa
    is_giving = time > 0 and row[ship + col.SHIP_BEHAVIOUR] == GIVING_WAY
    if time > 0 and is_near and time <= tcpa and not is_giving:
        bearing, aspect = bearing_of(-away_x, -away_y, course), bearing_of(away_x, away_y, row[col.HEADING])
        is_giving = must_give_way(bearing, aspect)
    behaviour = float32(GIVING_WAY if is_giving else GIVES_WAY)
    return course - (turn if is_giving and is_near else ZERO), behaviour


@compiled(RELAXED)
def closest_approach(ax: Number, ay: Number, bx: Number, by: Number) -> Number:
    """Return the least distance from the origin to a point that moves from a to b, as in `geometry`."""
    tx, ty = bx - ax, by - ay
    length2 = tx * tx + ty * ty
    share = float32(0.0)
    if length2 > 0:
        share = min(max(-(ax * tx + ay * ty) / length2, ZERO), ONE)
    return math.hypot(ax + share * tx, ay + share * ty)


@compiled(RELAXED)
def step(
    state: Array,
    action: Array,
    actions: Array,
    constants: Array,
    after: Array,
    to_goal: Array,
    flags: Array,
    min_distance: Array,
) -> None:
    """Take one action with each of N ships, and write the results into the last four arguments.

    The rewards are computed in `write_rewards`.

    Shapes, float32 unless said otherwise:
        Inputs: state [N, S]; action int64 [N]; actions [A, 2] (m/s, rad/s); constants [11].
        Outputs: after [N, S]; to_goal float64 [2, N]: distance (m) and angle off the bow (rad); flags
        bool [3, N]: goal, collision, truncated; min_distance [N]: least distance to a target ship (m).

    Raises:
        IndexError: action index out of range.
    """
    dt, safe_distance, goal_distance, max_steps = constants[:4]
    left_speed, left_turn, mean_speed, mean_turn = constants[4:8]
    tcpa, dcpa, rule_turn = constants[8:]
    for n in range(state.shape[0]):
        if action[n] < 0 or action[n] >= actions.shape[0]:
            raise IndexError("action index out of range")
        row, moved = state[n], after[n]
        for i in range(row.shape[0]):
            moved[i] = row[i]
        x, y = row[col.X], row[col.Y]
        speed, turn = actions[action[n]]
        speed_lag, turn_lag = row[col.SPEED] - speed, row[col.YAW_RATE] - turn
        heading = row[col.HEADING] + (turn + turn_lag * mean_turn) * dt
        way = (speed + speed_lag * mean_speed) * dt
        new_x, new_y = x + way * math.cos(heading), y + way * math.sin(heading)
        nearest = float32(np.inf)
        for k in range((row.shape[0] - col.OWN_SIZE) // col.SHIP_SIZE):
            if k >= row[col.SHIP_COUNT]:
                break
            ship = col.OWN_SIZE + col.SHIP_SIZE * k
            ship_x, ship_y, course = (
                row[ship + col.SHIP_X],
                row[ship + col.SHIP_Y],
                row[ship + col.SHIP_HEADING],
            )
            if row[ship + col.SHIP_BEHAVIOUR] in (GIVES_WAY, GIVING_WAY):
                course, moved[ship + col.SHIP_BEHAVIOUR] = give_way(row, ship, tcpa, dcpa, rule_turn)
                moved[ship + col.SHIP_HEADING] = course
            ship_way = row[ship + col.SHIP_SPEED] * dt
            new_ship_x = ship_x + ship_way * math.cos(course)
            new_ship_y = ship_y + ship_way * math.sin(course)
            moved[ship + col.SHIP_X], moved[ship + col.SHIP_Y] = new_ship_x, new_ship_y
            nearest = min(
                nearest, closest_approach(ship_x - x, ship_y - y, new_ship_x - new_x, new_ship_y - new_y)
            )
        east, north = row[col.GOAL_X] - new_x, row[col.GOAL_Y] - new_y
        distance = math.hypot(east, north)
        # Becomes float64 below, because `floor` returns an integer.
        off_bow = math.atan2(north, east) - heading
        off_bow -= float32(2 * math.pi) * math.floor((off_bow + float32(math.pi)) / float32(2 * math.pi))
        collided = nearest < safe_distance
        reached = distance <= goal_distance and not collided
        moved[col.X], moved[col.Y], moved[col.HEADING] = new_x, new_y, heading
        moved[col.SPEED], moved[col.YAW_RATE] = speed + speed_lag * left_speed, turn + turn_lag * left_turn
        moved[col.STEP] = row[col.STEP] + ONE
        to_goal[0, n], to_goal[1, n], min_distance[n] = distance, off_bow, nearest
        flags[0, n], flags[1, n] = reached, collided
        flags[2, n] = moved[col.STEP] >= max_steps and not reached and not collided


@compiled(RELAXED)
def write_rewards(
    action: Array,
    actions: Array,
    amounts: tuple[float, ...],
    to_goal: Array,
    flags: Array,
    min_distance: Array,
    reward: Array,
) -> None:
    """Write the rewards of one step of N ships into `reward`, float32 [N].

    Shapes: as in `step`; amounts of `TERMS` in float32.
    """
    for n in range(action.shape[0]):
        speed, turn = actions[action[n]]
        reached, collided = np.float32(flags[0, n]), np.float32(flags[1, n])
        distance, nearest = np.float32(to_goal[0, n]), min(min_distance[n], np.float32(MAX_SHIP_DISTANCE))
        paid = PaidStep(distance, to_goal[1, n], reached, collided, nearest, speed, turn)
        reward[n] = step_reward(amounts, paid)


class CompiledStep:
    """`Transition` as a compiled loop on the CPU.

    `step(state, action)` maps float32 [N, S] and int64 [N] to an `Outcome`.
    """

    def __init__(self, reference: Transition) -> None:
        world = reference.world
        self._constants = reference.actions.numpy(), constants(world)
        self._actions = self._constants[0]
        self._amounts = tuple(np.asarray(reference.amounts, np.float32))

    def step_into(
        self, state: Array, action: Array, after: Array, reward: Array, flags: Array, min_distance: Array
    ) -> None:
        """Take one action with each ship, and write the results into the last four arrays.

        Shapes: state, after float32 [N, S]; action int64 [N]; reward, min_distance float32 [N]; flags
        bool [3, N]: goal, collision, truncated.

        Raises:
            IndexError: action index out of range.
        """
        to_goal = np.empty((2, len(action)))
        step(state, action, *self._constants, after, to_goal, flags, min_distance)
        paid = action, self._actions, self._amounts, to_goal, flags, min_distance
        write_rewards(*paid, reward)

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship, as `step_into`; return the results as an `Outcome`."""
        count = state.shape[0]
        after, floats = torch.empty(state.shape, device="cpu"), torch.empty(2, count, device="cpu")
        flags = torch.empty(3, count, dtype=torch.bool, device="cpu")
        reward, min_distance = floats.unbind(0)
        inputs = state.contiguous().numpy(), action.contiguous().numpy()
        self.step_into(*inputs, after.numpy(), reward.numpy(), flags.numpy(), min_distance.numpy())
        goal, collision, truncated = flags.unbind(0)
        return Outcome(after, reward, goal, collision, truncated, min_distance)
