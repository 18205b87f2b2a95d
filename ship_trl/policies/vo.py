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
from dataclasses import dataclass, field

import torch
from tensordict import TensorDictBase
from torch import Tensor

from ship_trl.learn.rollout import Policy
from ship_trl.policies.encounter import Encounters, Onset, Steering, goal_course
from ship_trl.sim.encounter import Encounter, relative_motion, ship_velocities
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.geometry import closest_approach, predicted_approach, unit_vector
from ship_trl.sim.state import HEADING, is_present

# The encounters in which own ship leaves the target ship to port.
RULED = torch.tensor([Encounter.HEAD_ON, Encounter.GIVE_WAY, Encounter.OVERTAKING])
# The turn must keep this share of the distance to keep: less than 1, so that a ship at the margin may turn.
TURNING_SHARE = 0.98


@dataclass(frozen=True)
class Settings:
    """Parameters of the planner: metres, seconds, degrees.

    `margin` is added to the safe distance, and collisions after `horizon` do not count. The grid has headings
    within `heading_range` of own ship's by `heading_step`. `cone` is the cost of a velocity in a cone, plus
    `time` divided by the seconds to the collision; `rule` is the cost of leaving a ship on the wrong side;
    `wanted` is the cost of each (m/s)^2 from the wanted velocity.
    """

    margin: float = 10.0
    horizon: float = 30.0
    heading_range: float = 120.0
    heading_step: float = 2.5
    cone: float = 1000.0
    time: float = 100.0
    rule: float = 100.0
    wanted: float = 0.1
    onset: Onset = field(default_factory=lambda: Onset(dcpa=60.0, tcpa=30.0, clear=90.0))


class VelocityObstacles:
    """Chooses the cheapest velocity of a grid of V, and the action that leads to it."""

    def __init__(self, env: ShipEnv, settings: Settings) -> None:
        world = env.world
        self.settings, self.encounters = settings, Encounters(settings.onset)
        self.steering = Steering(world, env.device)
        count = round(settings.heading_range / settings.heading_step)
        offsets = torch.arange(-count, count + 1, device=env.device) * math.radians(settings.heading_step)
        speeds = self.steering.speed.unique()
        self.offset, self.speed = (grid.flatten() for grid in torch.meshgrid(offsets, speeds, indexing="ij"))
        self.cruise = world.actions[world.straight_action][0]
        self.radius = world.safe_distance + settings.margin
        speed, turn = max(world.actions, key=lambda action: abs(action[1]))
        self.time = self.offset.abs() / max(abs(turn), 1e-6)
        self.chord = self.time * speed * torch.sinc(self.offset / (2 * math.pi))

    def __call__(self, step: TensorDictBase) -> TensorDictBase:
        """Write `action` for the states of a batch."""
        best = self.costs(step["state"]).argmin(-1)
        return step.set("action", self.steering(self.offset[best], self.speed[best]))

    def costs(self, state: Tensor) -> Tensor:
        """Return the cost of each velocity, [N, V], for states [N, S]."""
        settings, heading = self.settings, state[:, HEADING, None]
        motion = relative_motion(state)
        classes = self.encounters.update(state, motion)
        own = self.speed[:, None] * unit_vector(heading + self.offset)  # [N, V, 2]
        wanted = self.cruise * unit_vector(goal_course(state))
        cost = settings.wanted * (own - wanted[:, None]).square().sum(-1)
        if not classes.shape[-1]:
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
        hits = ((dcpa < radius) & (tcpa > 0) & (entry < settings.horizon)) | in_turn
        hits &= is_present(state)[:, None]
        obstacle = hits * (settings.cone + settings.time / (1.0 + entry.clamp(min=0.0)))
        # Relative to the ship, own ship goes to the left of it, which leaves the ship to starboard.
        goes_left = away[..., 1] * relative[..., 0] - away[..., 0] * relative[..., 1] > 0
        is_ruled = torch.isin(classes, RULED.to(classes.device))[:, None]
        breaks = is_ruled & goes_left & (tcpa > 0)
        return cost + obstacle.amax(-1) + settings.rule * breaks.any(-1)


def vo(env: ShipEnv, _: int = 0, settings: Settings = Settings()) -> Policy:
    """Return the policy of velocity obstacles."""
    return VelocityObstacles(env, settings)
