"""The numbers of an episode after each step: reward by term, distances, DCPA and TCPA.

They follow from the states, the actions and the Q-values alone, so an unfinished episode has them too.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.config.types import Reward, World
from ship_trl.learn.rollout import Episode, outcome
from ship_trl.sim.cases import Case
from ship_trl.sim.dynamics import HEADING
from ship_trl.sim.geometry import closest_approach, predicted_approach, unit_vector
from ship_trl.sim.transition import Transition

Numbers = NDArray[np.float64]
# Names for people of the amounts of `Reward`; an amount that is not listed keeps its own name.
TERMS = {"goal": "goal", "collision": "collision", "k1": "distance", "k2": "deviation"}
# Moments within a step at which the closest approach is searched for.
MOMENTS = 20


@dataclass(frozen=True, eq=False)
class Telemetry:
    """An episode so far, of T steps and K target ships; metres, seconds, radians.

    `states` [T + 1, 4] and `ships` [T + 1, K, 2] are the positions, `actions` [T] and `q_values` [T, A]
    (None where the policy has none) the choices. After each step: `terms` (name to [T + 1]) and `total`
    [T + 1] are the return so far; `goal_distance` [T + 1]; `apart` [T + 1, K] is the distance of each ship,
    `closest` [T + 1, K] the least so far, within steps too; `dcpa` and `tcpa` [T + 1, K] are predicted from
    the courses and speeds of that moment. `outcome` is None while the episode has not ended.
    """

    case: Case
    world: World
    states: Numbers
    ships: Numbers
    actions: NDArray[np.int64]
    q_values: Numbers | None
    terms: dict[str, Numbers]
    total: Numbers
    goal_distance: Numbers
    apart: Numbers
    closest: Numbers
    dcpa: Numbers
    tcpa: Numbers
    outcome: str | None

    @property
    def steps(self) -> int:
        """Count the steps so far."""
        return len(self.actions)

    def at(self, position: float) -> tuple[Numbers, Numbers]:
        """Find own ship (x, y, heading) [3] and the target ships [K, 2] at a step or between two.

        All ships move on straight lines within a step. Own ship's course changes at once when a step begins;
        here it turns in the course of the step, for the eye.
        """
        position = min(max(position, 0.0), float(self.steps))
        before = min(int(position), max(0, self.steps - 1))
        after, share = min(before + 1, self.steps), position - before
        own = (1 - share) * self.states[before, :3] + share * self.states[after, :3]
        return own, (1 - share) * self.ships[before] + share * self.ships[after]

    def closest_places(self) -> tuple[Numbers, Numbers] | None:
        """Find own ship [2] and the nearest ship [2] at the closest approach; None without target ships."""
        moments = [self.at(k / MOMENTS) for k in range(MOMENTS * self.steps + 1)]
        pairs = [(own[:2], ship) for own, ships in moments for ship in ships]
        return min(pairs, key=lambda pair: math.dist(*pair), default=None)

    def action(self, step: int) -> int | None:
        """Return the action taken at a step, None after the last one."""
        return int(self.actions[step]) if step < self.steps else None

    def q(self, step: int) -> Numbers | None:
        """Return the Q-values of all actions [A] at a step, None where there are none."""
        return None if self.q_values is None or step >= self.steps else self.q_values[step]

    def is_danger(self, step: int, ship: int) -> bool:
        """Tell whether a ship will enter the safe circle if all keep course and speed."""
        return bool(self.tcpa[step, ship] > 0 and self.dcpa[step, ship] < self.world.safe_distance)


def split_q(q: Numbers) -> tuple[Numbers, Numbers]:
    """Split Q-values [..., A] into the value [...] and the advantage of each action [..., A].

    The dueling network subtracts the mean of its advantages, so the mean of Q is the value.
    """
    value = q.mean(-1, keepdims=True)
    return value[..., 0], q - value


def measure_episode(case: Case, world: World, episode: Episode) -> Telemetry:
    """Measure a whole episode."""
    return measure(case, world, episode.states, episode.actions, episode.q_values)


def measure(
    case: Case, world: World, states: Tensor, actions: Tensor, q_values: Tensor | None = None
) -> Telemetry:
    """Measure an episode so far, of T steps, which may be none.

    Shapes: states float [T + 1, 4], actions int64 [T], q_values float [T, A].
    """
    motion = Transition(case, world, torch.device("cpu"))
    after = motion(states[:-1], actions)
    goal, collision, truncated = (bool(f[-1:].any()) for f in (after.goal, after.collision, after.truncated))
    away = motion.relative_positions(states)
    apart = torch.linalg.vector_norm(away, dim=-1)
    within = torch.cat((apart[:1], closest_approach(away[:-1], away[1:])))
    # Own ship's speed is that of its last action; at the start, of its first, or 0 before there is any.
    speeds = motion.actions[actions, 0]
    speeds = torch.cat((speeds[:1] if len(speeds) else torch.zeros(1), speeds))
    velocity = motion.ship_velocity - (speeds[:, None] * unit_vector(states[:, HEADING]))[:, None]
    dcpa, tcpa = predicted_approach(away, velocity)
    return Telemetry(
        case=case,
        world=world,
        states=to_numbers(states),
        ships=to_numbers(away + states[:, None, :2]),
        actions=actions.cpu().numpy().astype(np.int64),
        q_values=None if q_values is None else to_numbers(q_values),
        terms=returns_by_term(case, world, states, actions),
        total=return_so_far(after.reward),
        goal_distance=to_numbers(motion.goal_distance(states)),
        apart=to_numbers(apart),
        closest=to_numbers(within.cummin(0).values if within.numel() else within),
        dcpa=to_numbers(dcpa),
        tcpa=to_numbers(tcpa),
        outcome=outcome(goal, collision) if goal or collision or truncated else None,
    )


def returns_by_term(case: Case, world: World, states: Tensor, actions: Tensor) -> dict[str, Numbers]:
    """Compute the return so far of each term, name to [T + 1]: the reward with all other amounts zero."""
    amounts = [field.name for field in fields(Reward) if not re.fullmatch(r"w\d", field.name)]
    returns = {}
    for name in amounts:
        others: dict[str, Any] = {other: 0.0 for other in amounts if other != name}
        alone = Transition(case, replace(world, reward=replace(world.reward, **others)), torch.device("cpu"))
        returns[TERMS.get(name, name)] = return_so_far(alone(states[:-1], actions).reward)
    return returns


def return_so_far(rewards: Tensor) -> Numbers:
    """Sum up rewards [T] from 0 on, to [T + 1]."""
    return np.concatenate(([0.0], rewards.double().cumsum(0).numpy()))


def to_numbers(values: Tensor) -> Numbers:
    """Copy a tensor as float64."""
    return values.double().numpy()
