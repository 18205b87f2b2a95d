"""Velocity obstacles with the steering rules, after Kuwata et al.

Source: Kuwata, Wolf, Zarzhitsky and Huntsberger, "Safe maritime autonomous navigation with COLREGS, using
velocity obstacles", IEEE Journal of Oceanic Engineering 39(1), 2014, doi 10.1109/JOE.2013.2254214. Theirs are
the cone, the rule, the hysteresis and the cost by time to collision and distance to the wanted velocity. The
costs of 1,000 and 100, and headings within 120 degrees by 2.5, are those of NTNU's colav-simulator.

Ours: distances and times are in the scale of this world. The grid's speeds are those of the actions. A cone
begins where the turn to its velocity ends, and the turn must be clear too: a turn here takes up to 20 s at
half the speed. A ship inside the margin must only come no nearer. Where no velocity is free, the cheapest one
is taken. Lags of own ship (`world.turn_time`, `world.speed_time`) are ignored, and target ships are assumed
to hold course and speed.
"""

from __future__ import annotations

import math

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.policies.steering import Steering
from ship_trl.sim.encounter import keeps_clear, limits_of, relative_motion, ship_velocities
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import closest_approach, predicted_approach, unit_vector
from ship_trl.sim.state import HEADING, SHIP_CLASS, goal_course, is_present, target_ships

# The turn must keep this share of the distance to keep: less than 1, so that a ship at the margin may turn.
TURNING_SHARE = 0.98
# Metres that are added to the safe distance; collisions after so many seconds do not count.
MARGIN, HORIZON = 10.0, 30.0
# The grid has headings within this range of own ship's, by this step, in degrees.
HEADING_RANGE, HEADING_STEP = 120.0, 2.5
# Costs: of a velocity in a cone, plus `TIME` divided by the seconds to the collision; of leaving a ship on
# the wrong side; and of each (m/s)^2 from the wanted velocity.
CONE, TIME, RULE, WANTED = 1000.0, 100.0, 100.0, 0.1


class VelocityObstacles:
    """Chooses the cheapest velocity of a grid of V, and the action that leads to it."""

    def __init__(self, env: ShipEnv, _: int = 0) -> None:
        world = env.world
        self.steering = Steering(world, env.device)
        count = round(HEADING_RANGE / HEADING_STEP)
        offsets = torch.arange(-count, count + 1, device=env.device) * math.radians(HEADING_STEP)
        speeds = self.steering.speed.unique()
        self.offset, self.speed = (grid.flatten() for grid in torch.meshgrid(offsets, speeds, indexing="ij"))
        self.cruise = world.actions[world.straight_action][0]
        self.radius, self.near = world.safe_distance + MARGIN, limits_of(world.safe_distance).dcpa
        speed, turn = max(world.actions, key=lambda action: abs(action[1]))
        self.time = self.offset.abs() / max(abs(turn), 1e-6)
        self.chord = self.time * speed * torch.sinc(self.offset / (2 * math.pi))

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        best = self.costs(step["state"]).argmin(-1)
        return step.set("action", self.steering(self.offset[best], self.speed[best]))

    def costs(self, state: Tensor) -> Tensor:
        """Return the cost of each velocity, [N, V], for states [N, S]."""
        heading = state[:, HEADING, None]
        motion = relative_motion(state)
        own = self.speed[:, None] * unit_vector(heading + self.offset)  # [N, V, 2]
        wanted = self.cruise * unit_vector(goal_course(state))
        cost = WANTED * (own - wanted[:, None]).square().sum(-1)
        if not motion.distance.shape[-1]:
            return cost
        velocity = ship_velocities(state)[:, None]  # [N, 1, K, 2]
        moved = self.chord[:, None] * unit_vector(heading + self.offset / 2)
        before = motion.position[:, None]
        away = before + velocity * self.time[:, None, None] - moved[:, :, None]  # [N, V, K, 2]
        relative = velocity - own[:, :, None]
        dcpa, tcpa = predicted_approach(away, relative)
        radius = motion.distance.clamp(max=self.radius)[:, None]
        in_turn = closest_approach(before.expand_as(away), away) < TURNING_SHARE * radius
        speed = torch.linalg.vector_norm(relative, dim=-1).clamp(min=1e-3)
        entry = tcpa - (radius.square() - dcpa.square()).clamp(min=0.0).sqrt() / speed
        entry = entry.masked_fill(in_turn, 0.0)
        hits = ((dcpa < radius) & (tcpa > 0) & (entry < HORIZON)) | in_turn
        hits &= is_present(state)[:, None]
        obstacle = hits * (CONE + TIME / (1.0 + entry.clamp(min=0.0)))
        # Relative to the ship, own ship goes to the left of it, which leaves the ship to starboard.
        goes_left = away[..., 1] * relative[..., 0] - away[..., 0] * relative[..., 1] > 0
        # Where own ship keeps clear, and the ships would pass near, it leaves the target ship to port.
        passes_near = (motion.tcpa > 0) & (motion.dcpa < self.near)
        keeps = keeps_clear(target_ships(state)[..., SHIP_CLASS]) & passes_near
        breaks = keeps[:, None] & goes_left & (tcpa > 0)
        return cost + obstacle.amax(-1) + RULE * breaks.any(-1)
