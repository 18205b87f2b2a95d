"""Measure episodes of encounters: their ends, distances, rule scores (`rules`) and detours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from ship_trl.config.bounds import HEAD_ON_DEGREES, RULES
from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.policies.rules import at, closest_pass, scaled_settings, score_rules
from ship_trl.sim.encounter import Encounter, relative_motion
from ship_trl.sim.state import goal, goal_distance, position

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measurements:
    """Metrics of N episodes.

    Attributes:
        outcomes: goal, collision or timeout, [N].
        encounters: class at the onset of the first encounter, of several the nearest ship's, [N].
        values: float64 [N] by name, NaN where a metric does not apply: return (raw, undiscounted), steps;
            least_distance to any target ship (m), within steps too; dcpa (m) and tcpa (s), predicted as the
            manoeuvre begins; rule_8 to rule_17, scores [N, K] for each target ship; path_ratio and
            time_ratio, way and time to the goal over those of the straight way, where the goal is reached.
    """

    outcomes: NDArray[np.str_]
    encounters: NDArray[np.str_]
    values: dict[str, Numbers]

    def select(self, rows: NDArray[np.bool_]) -> Measurements:
        """Return the metrics of some episodes, by flags [N]."""
        values = {name: value[rows] for name, value in self.values.items()}
        return Measurements(self.outcomes[rows], self.encounters[rows], values)

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
    scores = score_rules(states, last, world, scaled_settings(world, head_on))
    is_goal = torch.tensor([one.goal for one in episodes])
    path, time = route_ratios(states, last, world)
    ship = main_ship(states, last, scores.onset)
    classes, dcpa, tcpa = torch.full_like(last, Encounter.NONE), *torch.full((2, len(last)), math.nan)
    if ship is not None:
        dcpa, tcpa = (part.gather(1, ship)[:, 0] for part in approach_at(states, scores.manoeuvre))
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
        np.array([class_name(Encounter(one)) for one in classes.tolist()]),
        {name: value.double().numpy() for name, value in values.items()},
    )


def class_name(encounter: Encounter) -> str:
    """Return the name of an encounter class in tables: "head-on", "give way"."""
    return "head-on" if encounter is Encounter.HEAD_ON else encounter.name.lower().replace("_", " ")


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


def approach_at(states: Tensor, manoeuvre: Tensor) -> tuple[Tensor, Tensor]:
    """Return DCPA (m) and TCPA (s) of every ship at steps int64 [N, K]; NaN at step -1. States [N, T, S]."""
    motion = relative_motion(states)
    dcpa, tcpa = (at(part, manoeuvre.clamp(min=0)) for part in (motion.dcpa, motion.tcpa))
    return dcpa.masked_fill(manoeuvre < 0, math.nan), tcpa.masked_fill(manoeuvre < 0, math.nan)


def main_ship(states: Tensor, last: Tensor, onset: Tensor) -> Tensor | None:
    """Return the place of each episode's first encounter, int64 [N, 1], of several the nearest at the onset.

    Without an encounter it is the ship that comes nearest. None if no episode has a place for ships.
    Shapes: states [N, T + 1, S]; last int64 [N]; onset int64 [N, K], -1 without one.
    """
    if not onset.shape[1]:
        return None
    distance = at(relative_motion(states).distance, onset.clamp(min=0))
    nearest = closest_pass(states, torch.zeros_like(onset), last[:, None]).distance
    never = onset < 0
    rank = torch.where(never, nearest, distance)
    # An episode has far fewer steps, and its ships are nearer.
    order = torch.where(never, 1e12, onset * 1e7) + rank.nan_to_num(posinf=1e6).clamp(max=1e6)
    return order.argmin(1, keepdim=True)
