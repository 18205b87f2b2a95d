"""One step of the world as a compiled loop for the CPU.

It does what `transition.Transition` does in torch, which stays the reference and serves the GPU;
tests hold them together. In torch a small batch is all operator overhead.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import float32

from ship_trl.jit import RELAXED, compiled

Array = np.ndarray[Any, Any]
# float32 where it is compiled; Python and NumPy disagree on what that is.
Number = Any

# Plain numbers would make every sum a float64.
ONE, ZERO = np.float32(1.0), np.float32(0.0)


@compiled(RELAXED)
def closest(ax: Number, ay: Number, bx: Number, by: Number) -> Number:
    """Least distance from the origin of a point that moves from a to b (`geometry.closest_approach`)."""
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
    goal: Array,
    ships: Array,
    velocity: Array,
    limits: Array,
    after: Array,
    sight: Array,
    flags: Array,
    apart: Array,
) -> None:
    """One action of each of N ships (`transition.Transition`), written to the last four arguments.

    What it is paid is another loop's matter, `reward.pay`.

    Shapes: state, after [N, 4]; action [N]; actions [A, 2]; goal [2]; ships, velocity [K, 2];
    limits [4]: dt, safe distance, goal distance, steps; sight float64 [2, N]: the goal's distance and its
    angle off the bow (a float64, as `floor` gives an integer); flags [3, N]: goal, collision, truncated;
    apart [N].
    """
    dt, safe, near, most = limits
    for n in range(state.shape[0]):
        if action[n] < 0 or action[n] >= actions.shape[0]:
            raise IndexError("no such action")
        x, y, heading, count = state[n]
        speed, turn = actions[action[n]]
        heading = heading + turn * dt
        new_x = x + speed * dt * math.cos(heading)
        new_y = y + speed * dt * math.sin(heading)
        least = float32(np.inf)
        for k in range(ships.shape[0]):
            before, now = count * dt, (count + ONE) * dt
            ax = ships[k, 0] + before * velocity[k, 0] - x
            ay = ships[k, 1] + before * velocity[k, 1] - y
            bx = ships[k, 0] + now * velocity[k, 0] - new_x
            by = ships[k, 1] + now * velocity[k, 1] - new_y
            least = min(least, closest(ax, ay, bx, by))
        east, north = goal[0] - new_x, goal[1] - new_y
        distance = math.hypot(east, north)
        off_bow = math.atan2(north, east) - heading
        off_bow -= float32(2 * math.pi) * math.floor((off_bow + float32(math.pi)) / float32(2 * math.pi))
        collided = least < safe
        reached = distance <= near and not collided
        after[n, 0], after[n, 1], after[n, 2], after[n, 3] = new_x, new_y, heading, count + ONE
        sight[0, n], sight[1, n], apart[n] = distance, off_bow, least
        flags[0, n], flags[1, n] = reached, collided
        flags[2, n] = after[n, 3] >= most and not reached and not collided
