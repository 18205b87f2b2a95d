"""An artificial potential field.

Source: attraction to the goal and repulsion by 1/d after Khatib 1986 (doi 10.1177/027836498600500106). After
Lyu and Yin 2019 (doi 10.1017/S0373463318000796) only ships with which own ship is on collision course repel,
and part of the repulsion is perpendicular, to starboard.

Ours: the attraction has length 1, because only the direction of the sum is used. Distances are in the scale
of this world. A ship also repels if own ship would be on collision course on the straight way to the goal, so
that it does not swing back at once. The field has no memory and knows no encounter classes. Lags of own ship
(`world.turn_time`, `world.speed_time`) are ignored, and target ships are assumed to hold course and speed.
"""

from __future__ import annotations

import math

import torch
from tensordict import TensorDictBase

from ship_trl.learn.rollout import Policy
from ship_trl.policies.steering import Steering
from ship_trl.sim.encounter import own_velocity, ship_velocities
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import predicted_approach, unit_vector, wrap_angle
from ship_trl.sim.state import HEADING, goal_course, is_present, relative_positions

# Ships within `RANGE` (m) repel whose DCPA is below the safe distance and `MARGIN` (m), and whose TCPA is
# between 0 and `HORIZON` (s).
RANGE, MARGIN, HORIZON = 450.0, 15.0, 30.0
# The factor of the force, and the share of it that is perpendicular.
REPULSION, STARBOARD = 120.0, 1.0


def apf(env: ShipEnv, _: int = 0) -> Policy:
    """Return the policy that follows the force of an artificial potential field."""
    world, steering = env.world, Steering(env.world, env.device)
    cruise = world.actions[world.straight_action][0]
    safe = world.safe_distance

    def act(step: TensorDictBase) -> TensorDictBase:
        state = step["state"]
        toward = unit_vector(goal_course(state))
        away, ships = relative_positions(state), ship_velocities(state)
        distance = torch.linalg.vector_norm(away, dim=-1)
        repels = torch.zeros_like(distance, dtype=torch.bool)
        for velocity in (own_velocity(state), cruise * toward):
            dcpa, tcpa = predicted_approach(away, ships - velocity[:, None])
            repels |= (dcpa < safe + MARGIN) & (tcpa > 0) & (tcpa < HORIZON)
        repels &= is_present(state) & (distance < RANGE)
        gap = (distance - safe).clamp(min=1.0)
        force = REPULSION * (1 / gap - 1 / (RANGE - safe)) * repels
        bearing = away / distance.clamp(min=1e-6)[..., None]
        starboard = torch.stack((bearing[..., 1], -bearing[..., 0]), -1)
        push = (force[..., None] * (STARBOARD * starboard - bearing)).sum(-2)
        east, north = (toward + push).unbind(-1)
        error = wrap_angle(torch.atan2(north, east) - state[:, HEADING])
        error = error.clamp(-math.pi / 2, math.pi / 2)
        return step.set("action", steering(error, torch.full_like(error, cruise)))

    return act
