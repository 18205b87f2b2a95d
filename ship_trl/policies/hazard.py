"""The compiled loop of simulation-based MPC: the hazard along plans (`sb_mpc` says after whom)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ship_trl.jit import compiled
from ship_trl.sim.state import (
    GOAL_X,
    GOAL_Y,
    HEADING,
    OWN_SIZE,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SIZE,
    SHIP_SPEED,
    SHIP_X,
    SHIP_Y,
    X,
    Y,
)

Array = np.ndarray[Any, Any]


@compiled()
def write_hazards(
    state: Array,
    tracks: Array,
    dt: float,
    goal_distance: float,
    constants: tuple[float, ...],
    hazard: Array,
) -> None:
    """Write the greatest hazard along each plan into `hazard`, float64 [N, P].

    Shapes: state float64 [N, S]; tracks float64 [P, T, 2] in own ship's frame (m). `constants` are as in
    `sb_mpc.SimulationBasedMPC.hazards`; its angles are cosines here.
    """
    safe, close, p, q, k_coll, violation, kappa, crossed, overtaken, head_on, ahead = constants
    for n in range(hazard.shape[0]):
        row = state[n]
        cos, sin = math.cos(row[HEADING]), math.sin(row[HEADING])
        east, north = row[GOAL_X] - row[X], row[GOAL_Y] - row[Y]
        goal_x, goal_y = cos * east + sin * north, cos * north - sin * east
        for k in range(int(row[SHIP_COUNT])):
            ship = row[OWN_SIZE + SHIP_SIZE * k :]
            east, north = ship[SHIP_X] - row[X], ship[SHIP_Y] - row[Y]
            ship_x, ship_y = cos * east + sin * north, cos * north - sin * east
            course, ship_speed = ship[SHIP_HEADING] - row[HEADING], ship[SHIP_SPEED]
            ship_vx, ship_vy = ship_speed * math.cos(course), ship_speed * math.sin(course)
            for plan in range(hazard.shape[1]):
                own_x = own_y = 0.0
                for t in range(tracks.shape[1]):
                    own_vx, own_vy = (tracks[plan, t, 0] - own_x) / dt, (tracks[plan, t, 1] - own_y) / dt
                    x, y = ship_x + ship_vx * t * dt - own_x, ship_y + ship_vy * t * dt - own_y
                    vx, vy = ship_vx - own_vx, ship_vy - own_vy
                    speed2 = vx * vx + vy * vy
                    moment = -(x * vx + y * vy) / speed2 if speed2 > 0.0 else 0.0
                    moment = min(max(moment, 0.0), dt)
                    x, y = x + moment * vx, y + moment * vy
                    distance = math.hypot(x, y)
                    if distance < close:
                        risk = (safe / max(distance, 1.0)) ** q / ((t + 1) * dt) ** p
                        worst = k_coll * speed2 * risk + violation * max(safe - distance, 0.0) / safe
                        own_speed = math.hypot(own_vx, own_vy)
                        dot, speeds = own_vx * ship_vx + own_vy * ship_vy, own_speed * ship_speed
                        is_ahead = own_vx * x + own_vy * y > ahead * own_speed * distance
                        meets = is_ahead and dot < -head_on * speeds
                        is_overtaken = ship_speed > own_speed and dot > overtaken * speeds
                        crosses = dot < crossed * speeds and not is_overtaken
                        is_starboard = own_vx * y - own_vy * x < 0.0
                        if is_starboard and (meets or crosses):
                            worst += kappa
                        hazard[n, plan] = max(hazard[n, plan], worst)
                    own_x, own_y = tracks[plan, t]
                    if math.hypot(goal_x - own_x, goal_y - own_y) <= goal_distance:
                        break
