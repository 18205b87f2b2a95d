"""How steps keep the steering rules (COLREGs 8 and 13 to 17), as training can be paid for them.

The scores of whole episodes are in `policies.metrics`, whose module names their source. Here the same parts
are paid in the step that earns them: a timely and large action when it is taken, room and side of passing at
the closest approach.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.encounter import (
    TURN,
    Encounter,
    are_past,
    cruise_of,
    keeps_clear,
    ramp,
    relative_motion,
    stands_on,
    turn_since_onset,
    turns_starboard,
)
from ship_trl.sim.geometry import closest_approach
from ship_trl.sim.state import (
    SHIP_ACTION,
    SHIP_CLASS,
    SHIP_COUNT,
    is_present,
    relative_positions,
    target_ships,
)

# The source's collision radius (m).
COLLISION = 35.0
# Metres: an action before the first is timely; inside the second a ship that stands on may act.
STAGE3, STAGE4 = 236.0, 67.0
# Radii (m) of collision, near miss, minimum and preferred range, and what the range score gains between them.
RADII, GAINS = (COLLISION, 50.0, 100.0, 200.0), (0.5, 0.3, 0.2)

# What lacks in a pass counts so much, beside an action in full.
PASS = 2.0
# Own ship has acted from this size on: slowing down gives 0.5, a turn of 14 degrees the rest.
ACTED = 0.6


def safety_score(distance: Tensor, bearing: Tensor, aspect: Tensor, safe: float) -> Tensor:
    """Return the safety of passes (2): by range (3), and by pose at CPA (4 to 6); all are [...].

    The range score rises from 0 at the collision radius to 0.5, 0.8 and 1 at those of a near miss, the
    minimum and the preferred range.

    Args:
        distance: least distance (m).
        bearing: of the target ship from own ship at CPA (rad).
        aspect: bearing of own ship from the target ship at CPA (rad).
        safe: the world's safe distance (m), to which the source's radii are scaled.
    """
    radii, ranged = [radius * safe / COLLISION for radius in RADII], torch.zeros_like(distance)
    for low, high, gain in zip(radii[:-1], radii[1:], GAINS, strict=True):
        ranged += gain * ((distance - low) / (high - low)).clamp(0.0, 1.0)
    pose = 0.25 * (1 - aspect.cos()).clamp(max=1.0) + 0.75 * (1 - bearing.cos()).clamp(max=1.0)
    return (ranged + (1 - ranged) * pose) * (distance >= safe)


def wrong_side(kind: Tensor, bearing: Tensor, aspect: Tensor) -> Tensor:
    """Return what scores lose for the side of a pass: not port to port, or ahead of the other ship's bow.

    Args:
        kind: classes of encounter [...].
        bearing: of the target ship from own ship at CPA (rad) [...].
        aspect: bearing of own ship from the target ship at CPA (rad) [...].
    """
    port_to_port = ((aspect.sin() - 1) / 2).square() * ((bearing.sin() - 1) / 2).square()
    degrees = torch.rad2deg(aspect)
    return (
        0.6 * (1 - port_to_port) * (kind == Encounter.HEAD_ON)
        + 0.5 * ((degrees > -25) & (degrees < 165)) * (kind == Encounter.GIVE_WAY)
        + 0.3 * (degrees.abs() < 45) * (kind == Encounter.OVERTAKING)
    )


def rule_payment(before: Tensor, after: Tensor, world: World) -> Tensor:
    """Return what steps of N ships earn by the rules, [N]: at most 1 in an episode.

    It is the mean over target ships, and what a collision costs, as a pass without any safety does.

    Where own ship keeps clear, its action counts as far as it is timely; a turn to port before it costs where
    it must be to starboard, and at each CPA what safety and side of passing lack. Where it stands on, its
    action costs, until the ship is in stage 4.

    Args:
        before: states [N, S], with what `sim.encounter.Tracker` writes.
        after: states a step later.
        world: safe distance, speed of going straight.
    """
    safe = world.safe_distance
    kind, later = (target_ships(state)[..., SHIP_CLASS] for state in (before, after))
    first, then = relative_motion(before), relative_motion(after)
    goes_on = kind == later
    acted = (target_ships(after)[..., SHIP_ACTION] - target_ships(before)[..., SHIP_ACTION]) * goes_on
    is_ahead = ~are_past(before, first, cruise_of(world))
    timely = (first.distance / STAGE3).clamp(max=1.0)
    paid = acted * timely * (keeps_clear(kind) & is_ahead)
    paid = paid - acted * (stands_on(kind) & (first.distance > STAGE4))
    to_port = [ramp(torch.rad2deg(turn_since_onset(state)), TURN, power=1) for state in (before, after)]
    is_wrong = turns_starboard(kind) & is_ahead & goes_on & (target_ships(before)[..., SHIP_ACTION] < ACTED)
    paid = paid - (to_port[1] - to_port[0]).clamp(min=0.0) * is_wrong
    distance = closest_approach(relative_positions(before), relative_positions(after))
    lacks = 1 - safety_score(distance, then.bearing, then.aspect, safe)
    lacks = lacks + wrong_side(kind, then.bearing, then.aspect)
    paid = paid - PASS * lacks * (keeps_clear(kind) & (first.tcpa > 0) & (then.tcpa <= 0))
    # It ends the episode, and would save what passes lack. In a step with both, both count.
    collides = ((distance < safe) & is_present(before)).any(-1)
    return paid.sum(-1) / before[..., SHIP_COUNT].clamp(min=1) - PASS * collides
