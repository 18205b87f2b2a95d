"""Score how an episode keeps the steering rules (COLREGs 8 and 13 to 17), and how long its way is.

Source: Hagen et al., Ocean Engineering 288:115991, 2023, after Woerner et al. 2019
(doi 10.1007/s10514-018-9765-y), read from a public reconstruction. Numbers in parentheses are its equations.
Encounter classes are Pedersen's at the onset (`sim.encounter.classify`).

Ours: radii are scaled by 45/35, from their collision radius to the safe distance, and the stages by the
window of the picture. Where an encounter begins inside stage 3, the delay counts from its onset. Rule 17's
penalty is the larger of the apparent changes of course and speed before stage 4, and of a port turn in stage
4 towards a ship to port. In this world a hard turn also halves the speed, which counts as apparent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.policies.encounter import Onset
from ship_trl.sim.encounter import Encounter, Motion, classify, relative_motion
from ship_trl.sim.geometry import closest_approach, wrap_angle
from ship_trl.sim.state import HEADING, SHIP_COUNT, SPEED, goal_distance, position


@dataclass(frozen=True)
class Settings:
    """Parameters of the scores: metres, degrees, shares of the speed.

    The range score falls from 1 at `preferred` to 0.8 at `minimum`, 0.5 at `near_miss` and 0 at `collision`.
    A change of course or speed counts from the first of two bounds, and counts in full at the second.
    """

    preferred: float = 257.0
    minimum: float = 129.0
    near_miss: float = 64.0
    collision: float = 45.0
    stage3: float = 236.0
    stage4: float = 67.0
    turn: tuple[float, float] = (2.0, 30.0)
    slowing: tuple[float, float] = (0.07, 0.25)
    starboard: tuple[float, float] = (10.0, 30.0)
    onset: Onset = field(default_factory=lambda: Onset(dcpa=60.0, tcpa=30.0, clear=90.0))


@dataclass(frozen=True)
class ShipScore:
    """What an episode did about one target ship. Scores are from 0 to 1.

    Attributes:
        encounter: class at the onset; `NONE` without an onset.
        onset: step of the onset, -1 without one.
        least_distance: metres, within steps too.
        manoeuvre: step of the first change of course or speed after the onset, -1 without one.
        dcpa: DCPA (m) at the manoeuvre, NaN without one.
        tcpa: TCPA (s) at the manoeuvre, NaN without one.
        turn: largest change of course (degrees) between onset and CPA, starboard positive.
        safety: equation 2.
        rule8: apparent and timely; NaN without an onset, and for a ship that stands on.
        score: by the rule of the class; NaN without an onset. Head-on 14, give way 15 and 16, overtaking 13
            and 16, stand on and overtaken 17.
    """

    encounter: Encounter
    onset: int
    least_distance: float
    manoeuvre: int
    dcpa: float
    tcpa: float
    turn: float
    safety: float
    rule8: float
    score: float


def route_ratios(states: Tensor, world: World) -> tuple[float, float]:
    """Return way and time of an episode, each divided by that of the straight way to the goal.

    Args:
        states: states of an episode [T + 1, S]; one that reaches the goal, else the ratios mean nothing.
        world: goal distance, length of a step, speed of going straight.
    """
    straight = float(goal_distance(states[0])) - world.goal_distance
    way = float(torch.linalg.vector_norm(position(states).diff(dim=0), dim=-1).sum())
    time = (len(states) - 1) * world.dt
    return way / straight, time * world.actions[world.straight_action][0] / straight


def score_episode(states: Tensor, settings: Settings = Settings()) -> list[ShipScore]:
    """Score an episode's states [T + 1, S], once for each target ship."""
    states = states.double()
    motion = relative_motion(states)
    count = int(states[0, SHIP_COUNT])
    nearest = closest_approach(motion.position[:-1], motion.position[1:]).amin(0)
    return [_score_ship(states, motion, float(nearest[ship]), ship, settings) for ship in range(count)]


def _score_ship(states: Tensor, motion: Motion, nearest: float, ship: int, settings: Settings) -> ShipScore:
    """Score an episode towards one target ship, whose least distance is `nearest`."""
    one = Motion(*(part[:, ship] for part in motion))
    cpa = int(one.distance.argmin())
    bearing, aspect = float(one.bearing[cpa]), float(one.aspect[cpa])
    safety = safety_score(nearest, bearing, aspect, settings)
    at = settings.onset
    begins = (one.dcpa < at.dcpa) & (one.tcpa >= 0) & (one.tcpa <= at.tcpa)
    onset = first(begins)
    none = ShipScore(
        Encounter.NONE, -1, nearest, -1, math.nan, math.nan, math.nan, safety, math.nan, math.nan
    )
    if onset < 0:
        return none
    kind = Encounter(int(classify(one.bearing[onset], one.aspect[onset], math.radians(at.head_on))))
    if kind == Encounter.NONE:
        return none
    # Changes against the onset, until the closest approach.
    turns = -torch.rad2deg(wrap_angle(states[:, HEADING] - states[onset, HEADING]))
    slowing = (states[:, SPEED] / states[onset, SPEED].clamp(min=1e-6) - 1).abs()
    changes = (turns.abs() > settings.turn[0]) | (slowing > settings.slowing[0])
    during = slice(onset, max(cpa, onset) + 1)
    # The state before the first changed one is where the manoeuvre was chosen.
    changed = first(changes[during])
    manoeuvre = onset + changed - 1 if changed > 0 else -1
    turn = float(turns[during][turns[during].abs().argmax()])
    turned = ramp(abs(turn), settings.turn)
    slowed = ramp(float(slowing[during].max()), settings.slowing)
    apparent = (turned + slowed) / 2
    entry = min(settings.stage3, float(one.distance[onset]))
    delay = 1.0 if manoeuvre < 0 else max(0.0, (entry - float(one.distance[manoeuvre])) / entry)
    rule8 = apparent * (1 - delay)
    if kind in (Encounter.STAND_ON, Encounter.OVERTAKEN):
        rule8, score = math.nan, safety * (1 - _stand_on_penalty(one, turns, slowing, during, settings))
    elif kind == Encounter.HEAD_ON:
        no_starboard = 1 - ramp(float(turns[during].max()), settings.starboard, power=1)
        port_to_port = ((math.sin(aspect) - 1) / 2) ** 2 * ((math.sin(bearing) - 1) / 2) ** 2
        score = (1 - 0.4 * no_starboard - 0.6 * (1 - port_to_port)) * turned * (1 - delay)
    else:
        score = safety * rule8
        if kind == Encounter.GIVE_WAY and -25 < math.degrees(aspect) < 165:
            score -= 0.5
        if kind == Encounter.OVERTAKING and abs(math.degrees(aspect)) < 45:
            score -= 0.3
    return ShipScore(
        kind,
        onset,
        nearest,
        manoeuvre,
        float(one.dcpa[manoeuvre]) if manoeuvre >= 0 else math.nan,
        float(one.tcpa[manoeuvre]) if manoeuvre >= 0 else math.nan,
        turn,
        safety,
        rule8,
        max(score, 0.0),
    )


def safety_score(distance: float, bearing: float, aspect: float, settings: Settings = Settings()) -> float:
    """Return the safety of a pass (2): by range (3), and by pose at CPA (4 to 6).

    Args:
        distance: least distance (m).
        bearing: of the target ship from own ship at CPA (rad).
        aspect: bearing of own ship from the target ship at CPA (rad).
        settings: radii.
    """
    if distance < settings.collision:
        return 0.0
    radii = (settings.collision, settings.near_miss, settings.minimum, settings.preferred)
    values = (0.0, 0.5, 0.8, 1.0)
    ranged = 1.0
    for low, high, below, above in zip(radii[:-1], radii[1:], values[:-1], values[1:], strict=True):
        if distance < high:
            ranged = below + (above - below) * (distance - low) / (high - low)
            break
    pose = 0.25 * min(1.0, 1 - math.cos(aspect)) + 0.75 * min(1.0, 1 - math.cos(bearing))
    return ranged + (1 - ranged) * pose


def ramp(value: float, bounds: tuple[float, float], power: int = 2) -> float:
    """Return 0 below the first bound and 1 above the second, and the power of the share between."""
    low, high = bounds
    return float(min(max((value - low) / (high - low), 0.0), 1.0) ** power)


def first(flags: Tensor) -> int:
    """Return the index of the first true flag, or -1."""
    return int(flags.int().argmax()) if bool(flags.any()) else -1


def _stand_on_penalty(
    motion: Motion, turns: Tensor, slowing: Tensor, during: slice, settings: Settings
) -> float:
    """Return Rule 17's penalty, from 0 to 1, of the steps between onset and CPA."""
    is_far = motion.distance[during] > settings.stage4
    turn, slow = turns[during], slowing[during]
    far_turn = float((turn.abs() * is_far).max())
    far_slow = float((slow * is_far).max())
    # A port turn against the course at the beginning of stage 4.
    near = first(~is_far)
    port = 0.0
    if near >= 0:
        to_port = (turn[near] - turn[near:]) * (motion.bearing[during][near:] < 0)
        port = float(to_port.max())
    return max(ramp(far_turn, settings.turn), ramp(far_slow, settings.slowing), ramp(port, settings.turn))
