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
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.learn.rollout import Policy
from ship_trl.policies.encounter import goal_course
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import unit_vector, wrap_angle
from ship_trl.sim.state import HEADING, STEP

# Steps of a plan, of which at most so many turn or weave.
STEPS, TURNS = 20, 16
# Metres that are added to the safe distance, metres beyond which ships are no hazard, and the cost of a step
# at distance zero.
MARGIN, CLOSE, VIOLATION = 10.0, 100.0, 1000.0
# Names of costs are the paper's.
P, Q, K_COLL, KAPPA = 1.0, 4.0, 0.005, 10.0
K_SPEED, K_COURSE, K_CHANGE_STARBOARD, K_CHANGE_PORT = 0.25, 6.0, 0.25, 0.35
# Degrees.
CROSSED, OVERTAKEN, HEAD_ON, AHEAD = 68.5, 68.5, 22.5, 15.0


def make_plans(world: World, steps: int, turns: int) -> tuple[Tensor, Tensor]:
    """Return plans of held actions, int64 [P, steps], and their speed factors [P].

    The first plan goes straight, so it wins ties.
    """
    straight, actions = world.straight_action, world.actions
    fastest = actions[straight][0]
    plans, factors = [[straight] * steps], [1.0]
    turning = [index for index, (_, turn) in enumerate(actions) if turn]
    for action in turning:
        for count in range(1, turns + 1):
            plans.append([action] * count + [straight] * (steps - count))
            factors.append(1.0)
    for one in turning:
        for other in turning:
            if math.isclose(actions[one][1], -actions[other][1]):
                for count in range(2, turns + 1, 2):
                    plans.append([one, other] * (count // 2) + [straight] * (steps - count))
                    slow = (actions[one][0] + actions[other][0]) / 2
                    factors.append((count * slow / fastest + steps - count) / steps)
    return torch.tensor(plans), torch.tensor(factors)


class SimulationBasedMPC:
    """Chooses the cheapest of P plans, and takes its first action."""

    def __init__(self, env: ShipEnv) -> None:
        # Imported here: without compiled loops nothing needs numba.
        from ship_trl.policies.hazard import write_hazards

        world = self.world = env.world
        self.write_hazards = write_hazards
        plans, self.factors = (part.to(env.device) for part in make_plans(world, STEPS, TURNS))
        speed, turn = torch.tensor(world.actions, device=env.device)[plans].unbind(-1)
        turned = (turn * world.dt).cumsum(-1)
        way = ((speed * world.dt)[..., None] * unit_vector(turned)).cumsum(-2)
        self.first, self.turned = plans[:, 0], turned[:, -1]
        # Positions [P, T, 2] after each step in own ship's frame: ahead, to port.
        self.tracks = way.double().cpu().numpy()
        self.last = torch.empty(0)

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        state = step["state"]
        course = goal_course(state)
        if len(self.last) != len(state):
            self.last = course
        last = torch.where(state[:, STEP] == 0, course, self.last)
        final = state[:, HEADING, None] + self.turned  # [N, P]
        change = wrap_angle(final - last[:, None])
        k_change = torch.where(change > 0, K_CHANGE_PORT, K_CHANGE_STARBOARD)
        cost = (
            self.hazards(state)
            + K_SPEED * (1 - self.factors)
            + K_COURSE * wrap_angle(final - course[:, None]).square()
            + k_change * change.square()
        )
        best = cost.argmin(-1)
        self.last = final.gather(1, best[:, None])[:, 0]
        return step.set("action", self.first[best])

    def hazards(self, state: Tensor) -> Tensor:
        """Return the greatest hazard along each plan, [N, P], for states [N, S]."""
        world = self.world
        angles = (math.cos(math.radians(angle)) for angle in (CROSSED, OVERTAKEN, HEAD_ON, AHEAD))
        constants = (world.safe_distance + MARGIN, CLOSE, P, Q, K_COLL, VIOLATION, KAPPA, *angles)
        hazard = np.zeros((len(state), len(self.first)))
        self.write_hazards(
            state.double().cpu().numpy(), self.tracks, world.dt, world.goal_distance, constants, hazard
        )
        return torch.from_numpy(hazard).to(state)


def sb_mpc(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy of simulation-based model predictive control."""
    return SimulationBasedMPC(env)
