"""Simulation-based model predictive control, after Johansen et al.

Source: Johansen, Perez and Cristofaro, "Ship collision avoidance and COLREGS compliance using
simulation-based control behavior selection with predictive hazard assessment", IEEE Transactions on
Intelligent Transportation Systems 17(12), 2016, doi 10.1109/TITS.2016.2551780. Theirs are a set of
manoeuvres that are rolled out and held, the greatest hazard along each (risk, cost of collision, broken
rules), and the cost of an offset in course and speed, and of changing it. `p`, `q`, `kappa`, the angles and
the ratio of the costs to port and to starboard are NTNU's.

Ours: course offsets and speed factors are plans of held actions, because here speed and rate of turn come
together: turn for some steps, or weave (two opposite actions in turn, which is slow), then go straight. The
speed factor of a turn is 1. The horizon is 20 s in place of 150 s, `close` 100 m in place of 1,000 m,
`k_coll` 0.005 in place of 0.5, and the costs of course and change follow, tuned on the paper's cases and on
random encounters. A step inside the safe distance and a margin costs more the deeper it is. Steps after the
goal do not count. A step's distance is that of closest approach within it. Lags of own ship
(`world.turn_time`, `world.speed_time`) are ignored, and target ships are assumed to hold course and speed.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.fast.jit import compiled
from ship_trl.sim import state as col
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import unit_vector, wrap_angle
from ship_trl.sim.state import goal_course

Numbers = NDArray[np.float64]

# Steps of a plan, of which at most so many turn or weave.
STEPS, TURNS = 20, 16
# Metres that are added to the safe distance, metres beyond which ships are no hazard, and the cost of a step
# at distance zero.
MARGIN, CLOSE, VIOLATION = 10.0, 100.0, 1000.0
# Names of costs are the paper's.
P, Q, K_COLL, KAPPA = 1.0, 4.0, 0.005, 10.0
K_SPEED, K_COURSE, K_CHANGE_STARBOARD, K_CHANGE_PORT = 0.25, 6.0, 0.25, 0.35
# Cosines of 68.5, 68.5, 22.5 and 15 degrees.
CROSSED, OVERTAKEN, HEAD_ON, AHEAD = (math.cos(math.radians(angle)) for angle in (68.5, 68.5, 22.5, 15.0))


def make_plans(world: World) -> tuple[Tensor, Tensor]:
    """Return plans of held actions, int64 [P, STEPS], and their speed factors [P].

    The first plan goes straight, so it wins ties.
    """
    straight, actions = world.straight_action, world.actions
    fastest = actions[straight][0]
    plans, factors = [[straight] * STEPS], [1.0]
    turning = [index for index, (_, turn) in enumerate(actions) if turn]
    for action in turning:
        for count in range(1, TURNS + 1):
            plans.append([action] * count + [straight] * (STEPS - count))
            factors.append(1.0)
    for one in turning:
        for other in turning:
            if math.isclose(actions[one][1], -actions[other][1]):
                for count in range(2, TURNS + 1, 2):
                    plans.append([one, other] * (count // 2) + [straight] * (STEPS - count))
                    slow = (actions[one][0] + actions[other][0]) / 2
                    factors.append((count * slow / fastest + STEPS - count) / STEPS)
    return torch.tensor(plans), torch.tensor(factors)


class SimulationBasedMPC:
    """Chooses the cheapest of P plans, and takes its first action."""

    def __init__(self, env: ShipEnv, _: int = 0) -> None:
        world = self.world = env.world
        plans, self.factors = (part.to(env.device) for part in make_plans(world))
        speed, turn = torch.tensor(world.actions, device=env.device)[plans].unbind(-1)
        turned = (turn * world.dt).cumsum(-1)
        way = ((speed * world.dt)[..., None] * unit_vector(turned)).cumsum(-2)
        self.first, self.turned = plans[:, 0], turned[:, -1]
        # Positions [P, T, 2] after each step in own ship's frame: ahead, to port.
        self.tracks = way.double().cpu().numpy()
        self.last = torch.empty(0)

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        state, world = step["state"], self.world
        # The greatest hazard along each plan, [N, P].
        hazard = np.zeros((len(state), len(self.first)))
        rows, safe = state.double().cpu().numpy(), world.safe_distance + MARGIN
        write_hazards(rows, self.tracks, world.dt, world.goal_distance, safe, hazard)
        course = goal_course(state)
        if len(self.last) != len(state):
            self.last = course
        last = torch.where(state[:, col.STEP] == 0, course, self.last)
        final = state[:, col.HEADING, None] + self.turned  # [N, P]
        change = wrap_angle(final - last[:, None])
        k_change = torch.where(change > 0, K_CHANGE_PORT, K_CHANGE_STARBOARD)
        cost = (
            torch.from_numpy(hazard).to(state)
            + K_SPEED * (1 - self.factors)
            + K_COURSE * wrap_angle(final - course[:, None]).square()
            + k_change * change.square()
        )
        best = cost.argmin(-1)
        self.last = final.gather(1, best[:, None])[:, 0]
        return step.set("action", self.first[best])


@compiled()
def write_hazards(
    state: Numbers,
    tracks: Numbers,
    dt: float,
    goal_distance: float,
    safe: float,
    hazard: Numbers,
) -> None:
    """Write the greatest hazard along each plan into `hazard`, float64 [N, P].

    Shapes: state float64 [N, S]; tracks float64 [P, T, 2] in own ship's frame (m). `safe` is the safe
    distance with its margin (m).
    """
    for n in range(hazard.shape[0]):
        row = state[n]
        cos, sin = math.cos(row[col.HEADING]), math.sin(row[col.HEADING])
        east, north = row[col.GOAL_X] - row[col.X], row[col.GOAL_Y] - row[col.Y]
        goal_x, goal_y = cos * east + sin * north, cos * north - sin * east
        for k in range(int(row[col.SHIP_COUNT])):
            ship = row[col.OWN_SIZE + col.SHIP_SIZE * k :]
            east, north = ship[col.SHIP_X] - row[col.X], ship[col.SHIP_Y] - row[col.Y]
            ship_x, ship_y = cos * east + sin * north, cos * north - sin * east
            course, ship_speed = ship[col.SHIP_HEADING] - row[col.HEADING], ship[col.SHIP_SPEED]
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
                    if distance < CLOSE:
                        risk = (safe / max(distance, 1.0)) ** Q / ((t + 1) * dt) ** P
                        worst = K_COLL * speed2 * risk + VIOLATION * max(safe - distance, 0.0) / safe
                        own_speed = math.hypot(own_vx, own_vy)
                        dot, speeds = own_vx * ship_vx + own_vy * ship_vy, own_speed * ship_speed
                        is_ahead = own_vx * x + own_vy * y > AHEAD * own_speed * distance
                        meets = is_ahead and dot < -HEAD_ON * speeds
                        is_overtaken = ship_speed > own_speed and dot > OVERTAKEN * speeds
                        crosses = dot < CROSSED * speeds and not is_overtaken
                        is_starboard = own_vx * y - own_vy * x < 0.0
                        if is_starboard and (meets or crosses):
                            worst += KAPPA
                        hazard[n, plan] = max(hazard[n, plan], worst)
                    own_x, own_y = tracks[plan, t]
                    if math.hypot(goal_x - own_x, goal_y - own_y) <= goal_distance:
                        break
