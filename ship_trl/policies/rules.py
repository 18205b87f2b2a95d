"""Remember encounters, and score how episodes keep the steering rules (COLREGs 8 and 13 to 17).

Source: Hagen et al., Ocean Engineering 288:115991, 2023, after Woerner et al. 2019
(doi 10.1007/s10514-018-9765-y), read from a public reconstruction. Numbers in parentheses are its equations.
Encounter classes are Pedersen's, locked at the onset (`Encounters`).

Ours: radii are scaled from a collision radius of 35 m to the safe distance, and the stages by the window of
the picture. Where an encounter begins inside stage 3, the delay counts from its onset. Of several changes,
the manoeuvre is the one with the largest turn, and then the largest change of speed. A change begins where
course and speed were last held: within `HOLD` seconds the turn was below its first bound, and the change of
speed below its second, so that small corrections do not count. The manoeuvre must begin before the closest
approach, and then counts for at least `REACTION` seconds: it may open the range at once. Rule 17's penalty
is the largest of three: the apparent changes of course and of speed before stage 4, and a port turn in
stage 4 towards a ship to port. Rule 14 scores 0 after a collision, as the other rules do. In this world a
hard turn also halves the speed, which counts as apparent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.bounds import HEAD_ON_DEGREES
from ship_trl.config.types import World
from ship_trl.sim.encounter import Encounter, Motion, are_ruled, classify, relative_motion
from ship_trl.sim.geometry import angle_off_bow, nearest_points, wrap_angle
from ship_trl.sim.state import (
    HEADING,
    SHIP_HEADING,
    SPEED,
    STEP,
    is_present,
    relative_positions,
    target_ships,
)

# The source's collision radius (m).
COLLISION = 35.0
# Metres.
STAGE3, STAGE4 = 236.0, 67.0
# A change of course (degrees) or speed (shares) counts from the first bound, and in full at the second.
TURN, SPEED_CHANGE, STARBOARD = (2.0, 30.0), (0.07, 0.25), (10.0, 30.0)
# Seconds.
REACTION, HOLD = 10.0, 5.0


@dataclass(frozen=True)
class Onset:
    """When an encounter begins and ends. Metres, seconds, degrees.

    An encounter begins when DCPA is below `dcpa` and TCPA between 0 and `tcpa`. It ends when the ships move
    apart and are `clear` away from each other. Between the two its class stays (Rule 13(d)).
    """

    dcpa: float
    tcpa: float
    clear: float
    head_on: float = HEAD_ON_DEGREES


class Encounters:
    """Remembers the encounter class of every place, for rows whose episodes begin at different times."""

    def __init__(self, onset: Onset) -> None:
        self.onset, self.classes = onset, torch.empty(0, 0, dtype=torch.int64)

    def update(self, state: Tensor, motion: Motion) -> Tensor:
        """Return the classes now, int64 [N, K], for states [N, S]; step 0 begins a new episode."""
        onset, classes = self.onset, self.classes
        if classes.shape != motion.distance.shape:
            classes = torch.full_like(motion.distance, Encounter.NONE, dtype=torch.int64)
        is_over = (motion.tcpa < 0) & (motion.distance > onset.clear)
        classes = classes.masked_fill(is_over | (state[:, STEP, None] == 0), Encounter.NONE)
        begins = (classes == Encounter.NONE) & (motion.dcpa < onset.dcpa)
        begins &= (motion.tcpa >= 0) & (motion.tcpa <= onset.tcpa)
        found = classify(motion.bearing, motion.aspect, math.radians(onset.head_on))
        self.classes = torch.where(begins, found, classes)
        return self.classes


@dataclass(frozen=True)
class Settings:
    """Radii (m) of the range score, and when encounters begin.

    The range score falls from 1 at `preferred` to 0.8 at `minimum`, 0.5 at `near_miss` and 0 at `collision`.
    """

    preferred: float
    minimum: float
    near_miss: float
    collision: float
    onset: Onset


def scaled_settings(world: World, head_on: float = HEAD_ON_DEGREES) -> Settings:
    """Return the source's radii, scaled to a world's safe distance; `head_on` is a half-angle in degrees.

    An encounter begins when the DCPA is below 4/3 of the safe distance within the next 30 s.
    """
    safe = world.safe_distance
    preferred, minimum, near_miss = (radius * safe / COLLISION for radius in (200.0, 100.0, 50.0))
    onset = Onset(dcpa=safe * 4 / 3, tcpa=30.0, clear=2 * safe, head_on=head_on)
    return Settings(preferred, minimum, near_miss, safe, onset)


class Pass(NamedTuple):
    """The closest approach to each target ship, [N, K]; distance infinite where there is none.

    `step` is the step within which it happens, `distance` is in metres, and bearing and aspect (rad) are as
    in `sim.encounter.Motion`.
    """

    step: Tensor
    distance: Tensor
    bearing: Tensor
    aspect: Tensor


class Scores(NamedTuple):
    """What N episodes did about their K target ships.

    Attributes:
        encounter: classes at the onset, int64 [N, K]; `NONE` without an onset.
        onset: step of the onset, int64 [N, K]; -1 without one.
        manoeuvre: step at which the manoeuvre after it is chosen, int64 [N, K]; -1 without one.
        turn: largest change of course after the onset (degrees), starboard positive, [N, K].
        safety: equation 2, [N, K]; NaN without an onset.
        rules: scores from 0 to 1 by `config.bounds.RULES`, [N, K, 6]; NaN where a rule does not apply.
            Head-on 8 and 14, give way 8, 15 and 16, overtaking 8, 13 and 16, stand on and overtaken 17.
    """

    encounter: Tensor
    onset: Tensor
    manoeuvre: Tensor
    turn: Tensor
    safety: Tensor
    rules: Tensor


def score_rules(states: Tensor, last: Tensor, world: World, settings: Settings) -> Scores:
    """Score episodes by their states.

    Args:
        states: states of N episodes [N, T + 1, S], padded with any states at their ends.
        last: index of each episode's last state, int64 [N].
        world: length of a step.
        settings: radii and onset.
    """
    states, last = states.double(), last[:, None]
    motion = relative_motion(states)
    time = torch.arange(states.shape[1])[:, None]
    classes = _locked_classes(states, motion, settings.onset)
    begins = first((classes != Encounter.NONE) & (time < last[:, None]))
    has_onset, onset = begins >= 0, begins.clamp(min=0)
    kind = at(classes, onset).masked_fill(~has_onset, Encounter.NONE)
    cpa = closest_pass(states, onset, last)
    safety = safety_score(cpa.distance, cpa.bearing, cpa.aspect, settings)

    # Changes against the onset.
    heading, speed = (states[..., column, None].expand_as(motion.distance) for column in (HEADING, SPEED))
    turns = -torch.rad2deg(wrap_angle(heading - at(heading, onset)[:, None]))
    changes = (speed / at(speed, onset).clamp(min=1e-6)[:, None] - 1).abs()
    manoeuvre = _manoeuvre(turns, speed, changes, onset, last, cpa.step, world)
    manoeuvre = manoeuvre.masked_fill(~has_onset, -1)
    reaction = round(REACTION / world.dt)
    end = torch.where(manoeuvre < 0, cpa.step, torch.maximum(cpa.step, manoeuvre + reaction))
    during = (time >= onset[:, None]) & (time <= torch.minimum(end, last)[:, None])
    turn = at(turns, (turns.abs() * during).argmax(1))
    turned = ramp(turn.abs(), TURN)
    apparent = (turned + ramp((changes * during).amax(1), SPEED_CHANGE)) / 2
    entry = at(motion.distance, onset).clamp(max=STAGE3)
    begun = at(motion.distance, manoeuvre.clamp(min=0))
    timely = 1 - ((entry - begun) / entry).clamp(min=0.0).masked_fill(manoeuvre < 0, 1.0)

    rule8 = apparent * timely
    rule16 = safety * rule8
    sin_bearing, sin_aspect, aspect = cpa.bearing.sin(), cpa.aspect.sin(), torch.rad2deg(cpa.aspect)
    no_starboard = 1 - ramp((turns * during).amax(1), STARBOARD, power=1)
    not_port_to_port = 1 - ((sin_aspect - 1) / 2).square() * ((sin_bearing - 1) / 2).square()
    rule14 = (1 - 0.4 * no_starboard - 0.6 * not_port_to_port) * turned * timely * (safety > 0)
    rule13 = rule16 - 0.3 * (aspect.abs() < 45)
    rule15 = rule16 - 0.5 * ((aspect > -25) & (aspect < 165))
    rule17 = safety * (1 - _stand_on_penalty(motion, heading, turns, changes, during))
    head_on, crosses, overtakes = (
        kind == one for one in (Encounter.HEAD_ON, Encounter.GIVE_WAY, Encounter.OVERTAKING)
    )
    stands_on = (kind == Encounter.STAND_ON) | (kind == Encounter.OVERTAKEN)
    gives_way = crosses | overtakes
    applies = (head_on | gives_way, overtakes, head_on, crosses, gives_way, stands_on)
    scores = torch.stack((rule8, rule13, rule14, rule15, rule16, rule17), -1).clamp(min=0.0)
    return Scores(
        kind,
        begins,
        manoeuvre,
        turn * has_onset,
        safety.masked_fill(~has_onset, math.nan),
        scores.masked_fill(~torch.stack(applies, -1), math.nan),
    )


def closest_pass(states: Tensor, begin: Tensor, last: Tensor) -> Pass:
    """Return the closest approach between two states, within steps too.

    Shapes: states [N, T + 1, S]; indices `begin` [N, K] and `last` [N, 1], int64.
    """
    away, step = relative_positions(states), torch.arange(states.shape[1] - 1)[:, None]
    points = nearest_points(away[:, :-1], away[:, 1:])
    outside = (step < begin[:, None]) | (step >= last[:, None]) | ~is_present(states[:, :-1])
    distance = torch.linalg.vector_norm(points, dim=-1).masked_fill(outside, math.inf)
    nearest = distance.argmin(1)
    point = torch.stack([at(part, nearest) for part in points.unbind(-1)], -1)
    # Ships turn at the start of a step, and then move.
    own = at(states[:, 1:, HEADING, None].expand_as(distance), nearest)
    other, origin = at(target_ships(states)[:, 1:, :, SHIP_HEADING], nearest), torch.zeros_like(point)
    bearing, aspect = -angle_off_bow(origin, own, point), -angle_off_bow(point, other, origin)
    return Pass(nearest, at(distance, nearest), bearing, aspect)


def safety_score(distance: Tensor, bearing: Tensor, aspect: Tensor, settings: Settings) -> Tensor:
    """Return the safety of passes (2): by range (3), and by pose at CPA (4 to 6); all are [...].

    Args:
        distance: least distance (m).
        bearing: of the target ship from own ship at CPA (rad).
        aspect: bearing of own ship from the target ship at CPA (rad).
        settings: radii.
    """
    radii = (settings.collision, settings.near_miss, settings.minimum, settings.preferred)
    ranged = torch.zeros_like(distance)
    for low, high, gain in zip(radii[:-1], radii[1:], (0.5, 0.3, 0.2), strict=True):
        ranged += gain * ((distance - low) / (high - low)).clamp(0.0, 1.0)
    pose = 0.25 * (1 - aspect.cos()).clamp(max=1.0) + 0.75 * (1 - bearing.cos()).clamp(max=1.0)
    return (ranged + (1 - ranged) * pose) * (distance >= settings.collision)


def ramp(value: Tensor, bounds: tuple[float, float], power: int = 2) -> Tensor:
    """Return 0 below the first bound and 1 above the second, and the power of the share between."""
    low, high = bounds
    return ((value - low) / (high - low)).clamp(0.0, 1.0) ** power


def first(flags: Tensor) -> Tensor:
    """Return the time of the first true flag, int64 [N, K], or -1, for flags [N, T, K]."""
    return flags.to(torch.int8).argmax(1).masked_fill(~flags.any(1), -1)


def at(values: Tensor, time: Tensor) -> Tensor:
    """Return values [N, T, K] at times int64 [N, K]."""
    return values.gather(1, time[:, None])[:, 0]


def _locked_classes(states: Tensor, motion: Motion, onset: Onset) -> Tensor:
    """Return encounter classes that stay from onset to past and clear, int64 [N, T + 1, K]."""
    encounters = Encounters(onset)
    motion = motion._replace(dcpa=motion.dcpa.masked_fill(~are_ruled(states, motion), math.inf))
    steps = range(states.shape[1])
    return torch.stack(
        [encounters.update(states[:, t], Motion(*(part[:, t] for part in motion))) for t in steps], 1
    )


def _manoeuvre(
    turns: Tensor,
    speed: Tensor,
    changes: Tensor,
    onset: Tensor,
    last: Tensor,
    cpa: Tensor,
    world: World,
) -> Tensor:
    """Return the step at which the manoeuvre is chosen, int64 [N, K]; -1 without one.

    Args:
        turns: changes of course since the onset, in degrees [N, T, K].
        speed: own ship's, in m/s, likewise.
        changes: of speed since the onset, as shares, likewise.
        onset: step of the onset, int64 [N, K].
        last: step of the last state, int64 [N, 1].
        cpa: step of the closest approach, int64 [N, K].
        world: length of a step.
    """
    time = torch.arange(turns.shape[1])[:, None]
    hold, reaction = (round(seconds / world.dt) for seconds in (HOLD, REACTION))
    before = torch.maximum(time - hold, onset[:, None])
    turned = (turns - turns.gather(1, before)).abs()
    sped = (speed / speed.gather(1, before).clamp(min=1e-6) - 1).abs()
    is_held = (turned <= TURN[0]) & (sped < SPEED_CHANGE[1])
    begin = torch.where(is_held, time, 0).cummax(1).values
    end = torch.maximum(cpa[:, None], begin + reaction)
    counts = ~is_held & (begin >= onset[:, None]) & (begin <= cpa[:, None])
    counts &= time <= torch.minimum(end, last[:, None])
    size = turns.abs().clamp(max=TURN[1]) + ramp(changes, SPEED_CHANGE)
    return at(begin, (size * counts).argmax(1)).masked_fill(~counts.any(1), -1)


def _stand_on_penalty(
    motion: Motion, heading: Tensor, turns: Tensor, changes: Tensor, during: Tensor
) -> Tensor:
    """Return Rule 17's penalties, from 0 to 1, [N, K]."""
    is_near = (((motion.distance <= STAGE4) & during).cumsum(1) > 0) & during
    is_far = during & ~is_near
    # Port turns that begin while the ship is to port, net of starboard ones.
    turns_to_ship = (is_near & (motion.bearing < 0))[:, :-1] & during[:, 1:]
    port = torch.rad2deg(wrap_angle(heading.diff(dim=1))) * turns_to_ship
    penalties = (
        ramp((turns.abs() * is_far).amax(1), TURN),
        ramp((changes * is_far).amax(1), SPEED_CHANGE),
        ramp(port.cumsum(1).amax(1), TURN),
    )
    return torch.stack(penalties).amax(0)
