"""Measure episodes of encounters: their ends, distances, detours, and how they keep the steering rules.

Rules are COLREGs 8 and 13 to 17, scored as by Hagen et al., Ocean Engineering 288:115991, 2023, after Woerner
et al. 2019 (doi 10.1007/s10514-018-9765-y), read from a public reconstruction. Numbers in parentheses are its
equations. Encounter classes are Pedersen's, locked at the onset (`sim.encounter.classes_at_onset`).

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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from ship_trl.config.bounds import HEAD_ON_DEGREES, RULES
from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.sim import state as col
from ship_trl.sim.encounter import (
    SPEED_CHANGE,
    TURN,
    Encounter,
    Motion,
    classes_at_onset,
    limits_of,
    ramp,
    relative_motion,
    stands_on,
)
from ship_trl.sim.geometry import angle_off_bow, nearest_points, wrap_angle
from ship_trl.sim.rules import STAGE3, STAGE4, safety_score, wrong_side
from ship_trl.sim.state import goal, goal_distance, is_present, position, relative_positions, target_ships

Numbers = NDArray[np.float64]
# As `sim.encounter.TURN`, of a starboard turn that Rule 14 asks for.
STARBOARD = (10.0, 30.0)
# Seconds.
REACTION, HOLD = 10.0, 5.0
# Encounter classes in tables.
CLASS_NAMES = ("none", "head-on", "give way", "stand on", "overtaking", "overtaken")


@dataclass(frozen=True, eq=False)
class Measurements:
    """Metrics of N episodes.

    Attributes:
        outcomes: goal, collision or timeout, [N].
        encounters: class at the onset of the first encounter, of several the nearest ship's, [N].
        ships: what own ship did about each engaged ship (see `Scores`), [N, K] by name, "" or NaN where
            something does not apply: encounter, its class, "none" unless the ship is engaged; side of the
            first action: starboard, port or none; turn, the largest to that side (degrees); range at which it
            begins (m); flags (1, 0) bow_crossing, kept_course, and, head-on and giving way, obeys: own ship
            turns at least 10 degrees to starboard, and crosses no bow.
        values: float64 [N] by name, NaN where a metric does not apply: return (raw, undiscounted), steps;
            least_distance to any target ship (m), within steps too; dcpa (m) and tcpa (s), predicted as the
            manoeuvre begins; rule_8 to rule_17, scores [N, K] for each target ship; path_ratio and
            time_ratio, way and time to the goal over those of the straight way, where the goal is reached.
    """

    outcomes: NDArray[np.str_]
    encounters: NDArray[np.str_]
    ships: dict[str, NDArray[Any]]
    values: dict[str, Numbers]

    def select(self, rows: NDArray[np.bool_]) -> Measurements:
        """Return the metrics of some episodes, by flags [N]."""
        ships, values = (
            {name: value[rows] for name, value in one.items()} for one in (self.ships, self.values)
        )
        return Measurements(self.outcomes[rows], self.encounters[rows], ships, values)

    def known(self, name: str) -> Numbers:
        """Return all values of a metric that apply, in one row."""
        values = self.values[name].ravel()
        return values[~np.isnan(values)]

    def of_episode(self, row: int) -> dict[str, float]:
        """Return each metric of one episode; a rule score is the mean over its ships."""
        found = {}
        for name, values in self.values.items():
            value = np.atleast_1d(values[row])
            value = value[~np.isnan(value)]
            found[name] = float(value.mean()) if value.size else math.nan
        return found


def measure_episodes(
    episodes: Sequence[Episode], world: World, head_on: float = HEAD_ON_DEGREES
) -> Measurements:
    """Measure finished episodes of one suite.

    Args:
        episodes: N episodes, at least one.
        world: physics, and the distances to keep and to reach.
        head_on: half-angle of the head-on sector, in degrees.
    """
    states = pad_sequence([one.states for one in episodes], batch_first=True).double()
    last = torch.tensor([one.length for one in episodes])
    scores = score_rules(states, last, world, head_on)
    is_goal = torch.tensor([one.goal for one in episodes])
    path, time = route_ratios(states, last, world)
    classes, dcpa, tcpa = torch.full_like(last, Encounter.NONE), *torch.full((2, len(last)), math.nan)
    if scores.onset.shape[1]:
        motion, onset, manoeuvre = relative_motion(states), scores.onset, scores.manoeuvre
        # The ship of the first encounter, of several the nearest at the onset; without an encounter the one
        # that comes nearest. An episode has far fewer steps than 1e5, and its ships are nearer than 1e6 m.
        passed = closest_pass(states, torch.zeros_like(onset), last[:, None])[1]
        rank = torch.where(onset < 0, passed, at(motion.distance, onset.clamp(min=0)))
        order = torch.where(onset < 0, 1e12, onset * 1e7) + rank.nan_to_num(posinf=1e6).clamp(max=1e6)
        ship = order.argmin(1, keepdim=True)
        predicted = (at(part, manoeuvre.clamp(min=0)) for part in (motion.dcpa, motion.tcpa))
        dcpa, tcpa = (one.masked_fill(manoeuvre < 0, math.nan).gather(1, ship)[:, 0] for one in predicted)
        classes = scores.encounter.gather(1, ship)[:, 0]
    nearest = [one.dcpa if math.isfinite(one.dcpa) else math.nan for one in episodes]
    values = {
        "return": torch.tensor([one.episode_return for one in episodes]),
        "steps": last,
        "least_distance": torch.tensor(nearest),
        "dcpa": dcpa,
        "tcpa": tcpa,
        **{f"rule_{rule}": scores.rules[..., k] for k, rule in enumerate(RULES)},
        "path_ratio": path.masked_fill(~is_goal, math.nan),
        "time_ratio": time.masked_fill(~is_goal, math.nan),
    }
    return Measurements(
        np.array([one.outcome for one in episodes]),
        np.array([CLASS_NAMES[one] for one in classes.tolist()]),
        describe_ships(scores, is_present(states[:, 0])),
        {name: value.double().numpy() for name, value in values.items()},
    )


def describe_ships(scores: Scores, present: Tensor) -> dict[str, NDArray[Any]]:
    """Return `Measurements.ships` for scores [N, K] and flags of places that hold a ship, [N, K]."""
    kind, turn, crosses_bow = scores.encounter, scores.turn, scores.crosses_bow
    is_engaged = ~turn.isnan()
    names = np.array(CLASS_NAMES)[kind.where(is_engaged, Encounter.NONE).numpy()]
    sides = np.array(["none", "starboard", "port"])[turn.nan_to_num().sign().long().numpy()]
    obeys = ((turn >= STARBOARD[0]) & (crosses_bow == 0)).double()
    asks = is_engaged & ((kind == Encounter.HEAD_ON) | (kind == Encounter.GIVE_WAY))
    return {
        "encounter": np.where(present, names, ""),
        "side": np.where(is_engaged, sides, ""),
        "turn": turn.abs().numpy(),
        "range": scores.action_range.numpy(),
        "bow_crossing": crosses_bow.numpy(),
        "kept_course": scores.keeps_course.numpy(),
        "obeys": obeys.masked_fill(~asks, math.nan).numpy(),
    }


def route_ratios(states: Tensor, last: Tensor, world: World) -> tuple[Tensor, Tensor]:
    """Return way and time of episodes, each divided by that of the straight way to the goal; both [N].

    Args:
        states: states [N, T + 1, S], padded at the ends. For episodes that do not reach the goal the ratios
            mean nothing.
        last: index of each episode's last state, int64 [N].
        world: goal distance, length of a step, speed of going straight.
    """
    straight = goal_distance(states[:, 0]) - world.goal_distance
    moves = position(states).diff(dim=1)
    moved = torch.linalg.vector_norm(moves, dim=-1)
    way = (moved * (torch.arange(moved.shape[1]) < last[:, None])).sum(-1)
    # The last step counts to where it enters the circle around the goal, a root of a quadratic equation.
    rows, final = torch.arange(len(states)), (last - 1).clamp(min=0)
    start, move = (position(states) - goal(states))[rows, final], moves[rows, final]
    half, square = (start * move).sum(-1), move.square().sum(-1).clamp(min=1e-12)
    root = (half.square() - square * (start.square().sum(-1) - world.goal_distance**2)).clamp(min=0.0).sqrt()
    way -= (1 - ((-half - root) / square).clamp(0.0, 1.0)) * moved[rows, final]
    return way / straight, last * world.dt * world.actions[world.straight_action][0] / straight


class Scores(NamedTuple):
    """What N episodes did about their K target ships.

    Attributes:
        encounter: classes at the onset, int64 [N, K]; `NONE` without an onset.
        onset: step of the onset, int64 [N, K]; -1 without one.
        manoeuvre: step at which the manoeuvre after it is chosen, int64 [N, K]; -1 without one.
        rules: scores from 0 to 1 by `config.bounds.RULES`, [N, K, 6]; NaN where a rule does not apply.
            Head-on 8 and 14, give way 8, 15 and 16, overtaking 8, 13 and 16, stand on and overtaken 17.
        turn: largest turn to the side of the first action (degrees, starboard positive), [N, K]; 0 without
            an action, NaN where no ship is engaged.
        action_range: distance at which the first action begins (m), [N, K]; NaN without one.
        crosses_bow: 1 or 0, [N, K], by the aspect at the closest approach, as Rules 13 and 15 count it;
            head-on 1 unless ships pass port to port; NaN where own ship stands on or no ship is engaged.
        keeps_course: 1 or 0, [N, K]: whether own ship holds course and speed until stage 4; NaN unless it
            stands on to an engaged ship.
    """

    encounter: Tensor
    onset: Tensor
    manoeuvre: Tensor
    rules: Tensor
    turn: Tensor
    action_range: Tensor
    crosses_bow: Tensor
    keeps_course: Tensor


def score_rules(states: Tensor, last: Tensor, world: World, head_on: float = HEAD_ON_DEGREES) -> Scores:
    """Score episodes by their states; distances are in the scale of the world's safe distance.

    An encounter begins when the DCPA is below 4/3 of the safe distance within the next 30 s. A ship with
    which one begins while own ship is under way is engaged. The first action is own ship's first change of
    course after that.

    Args:
        states: states of N episodes [N, T + 1, S], padded with any states at their ends.
        last: index of each episode's last state, int64 [N].
        world: length of a step, safe distance.
        head_on: half-angle of the head-on sector, in degrees.
    """
    states, last, safe = states.double(), last[:, None], world.safe_distance
    motion = relative_motion(states)
    limits = limits_of(safe, math.radians(head_on))
    classes = classes_at_onset(states, motion, limits)
    time = torch.arange(states.shape[1])[:, None]
    begins = first((classes != Encounter.NONE) & (time < last[:, None]))
    has_onset, onset = begins >= 0, begins.clamp(min=0)
    kind = at(classes, onset).masked_fill(~has_onset, Encounter.NONE)
    cpa, distance, bearing, aspect = closest_pass(states, onset, last)
    safety = safety_score(distance, bearing, aspect, safe)

    # Changes against the onset.
    heading, speed = (
        states[..., column, None].expand_as(motion.distance) for column in (col.HEADING, col.SPEED)
    )
    turns = -torch.rad2deg(wrap_angle(heading - at(heading, onset)[:, None]))
    changes = (speed / at(speed, onset).clamp(min=1e-6)[:, None] - 1).abs()

    # A change begins where course and speed were last held; the largest that counts is the manoeuvre.
    hold, reaction = (round(seconds / world.dt) for seconds in (HOLD, REACTION))
    before = torch.maximum(time - hold, onset[:, None])
    swung = (turns - turns.gather(1, before)).abs()
    sped = (speed / speed.gather(1, before).clamp(min=1e-6) - 1).abs()
    is_steady, span = swung <= TURN[0], (onset, cpa, last, reaction)
    begin, counts = find_changes(is_steady & (sped < SPEED_CHANGE[1]), *span)
    size = turns.abs().clamp(max=TURN[1]) + ramp(changes, SPEED_CHANGE)
    manoeuvre = at(begin, (size * counts).argmax(1)).masked_fill(~(counts.any(1) & has_onset), -1)

    # The first action is a change of course: speed changes with it, and back after a small correction.
    begin, counts = find_changes(is_steady, *span)
    acts, action = counts.any(1), at(begin, counts.to(torch.int8).argmax(1))
    side = at(turns, (turns.abs() * (counts & (begin == action[:, None]))).argmax(1)).sign() * acts

    end = torch.where(manoeuvre < 0, cpa, torch.maximum(cpa, manoeuvre + reaction))
    during = (time >= onset[:, None]) & (time <= torch.minimum(end, last)[:, None])
    turned = ramp((turns.abs() * during).amax(1), TURN)
    turn = side * (turns * side[:, None] * during).amax(1)
    apparent = (turned + ramp((changes * during).amax(1), SPEED_CHANGE)) / 2
    entry = at(motion.distance, onset).clamp(max=STAGE3)
    begun = at(motion.distance, manoeuvre.clamp(min=0))
    timely = 1 - ((entry - begun) / entry).clamp(min=0.0).masked_fill(manoeuvre < 0, 1.0)

    rule8 = apparent * timely
    rule16 = safety * rule8
    wrong = wrong_side(kind, bearing, aspect)
    no_starboard = 1 - ramp((turns * during).amax(1), STARBOARD, power=1)
    rule14 = (1 - 0.4 * no_starboard - wrong) * turned * timely * (safety > 0)
    # Each applies to encounters of its own class.
    rule13 = rule15 = rule16 - wrong
    penalties = _stand_on_penalties(motion, heading, turns, changes, during)
    rule17 = safety * (1 - penalties.amax(0))
    meets, crosses, overtakes = (
        kind == one for one in (Encounter.HEAD_ON, Encounter.GIVE_WAY, Encounter.OVERTAKING)
    )
    gives_way, stays = crosses | overtakes, stands_on(kind)
    applies = (meets | gives_way, overtakes, meets, crosses, gives_way, stays)
    scores = torch.stack((rule8, rule13, rule14, rule15, rule16, rule17), -1).clamp(min=0.0)
    is_engaged = has_onset & (at(speed, onset) > 0)
    is_port_to_port = (bearing < 0) & (aspect < 0)
    crosses_bow = torch.where(meets, ~is_port_to_port, wrong > 0)
    return Scores(
        kind,
        begins,
        manoeuvre,
        scores.masked_fill(~torch.stack(applies, -1), math.nan),
        turn.masked_fill(~is_engaged, math.nan),
        at(motion.distance, action).masked_fill(~(is_engaged & acts), math.nan),
        crosses_bow.double().masked_fill(~is_engaged | stays, math.nan),
        (penalties[:2].amax(0) == 0).double().masked_fill(~(is_engaged & stays), math.nan),
    )


def find_changes(
    is_held: Tensor, onset: Tensor, cpa: Tensor, last: Tensor, reaction: int
) -> tuple[Tensor, Tensor]:
    """Return where the change that each state is part of begins, and whether it is part of one that counts.

    Args:
        is_held: whether nothing changed just before, bool [N, T + 1, K]; the results have this shape.
        onset: step from which changes count, int64 [N, K].
        cpa: step until which a change must begin, int64 [N, K].
        last: index of each episode's last state, int64 [N, 1].
        reaction: steps for which a change counts at least.
    """
    time = torch.arange(is_held.shape[1])[:, None]
    begin = torch.where(is_held, time, 0).cummax(1).values
    until = torch.minimum(torch.maximum(cpa[:, None], begin + reaction), last[:, None])
    return begin, ~is_held & (begin >= onset[:, None]) & (begin <= cpa[:, None]) & (time <= until)


def closest_pass(states: Tensor, begin: Tensor, last: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the closest approach to each target ship between two states, within steps too.

    Shapes: states [N, T + 1, S]; indices `begin` [N, K] and `last` [N, 1], int64.

    Returns:
        The step within which it happens, the distance (m, infinite where there is no ship), and bearing and
        aspect (rad) as in `sim.encounter.Motion`, [N, K] each.
    """
    away, step = relative_positions(states), torch.arange(states.shape[1] - 1)[:, None]
    points = nearest_points(away[:, :-1], away[:, 1:])
    outside = (step < begin[:, None]) | (step >= last[:, None]) | ~is_present(states[:, :-1])
    distance = torch.linalg.vector_norm(points, dim=-1).masked_fill(outside, math.inf)
    nearest = distance.argmin(1)
    point = torch.stack([at(part, nearest) for part in points.unbind(-1)], -1)
    # Ships turn at the start of a step, and then move.
    own = at(states[:, 1:, col.HEADING, None].expand_as(distance), nearest)
    other, origin = at(target_ships(states)[:, 1:, :, col.SHIP_HEADING], nearest), torch.zeros_like(point)
    bearing, aspect = -angle_off_bow(origin, own, point), -angle_off_bow(point, other, origin)
    return nearest, at(distance, nearest), bearing, aspect


def first(flags: Tensor) -> Tensor:
    """Return the time of the first true flag, int64 [N, K], or -1, for flags [N, T, K]."""
    return flags.to(torch.int8).argmax(1).masked_fill(~flags.any(1), -1)


def at(values: Tensor, time: Tensor) -> Tensor:
    """Return values [N, T, K] at times int64 [N, K]."""
    return values.gather(1, time[:, None])[:, 0]


def _stand_on_penalties(
    motion: Motion, heading: Tensor, turns: Tensor, changes: Tensor, during: Tensor
) -> Tensor:
    """Return Rule 17's penalties for course, speed and port turns, from 0 to 1, [3, N, K]."""
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
    return torch.stack(penalties)
