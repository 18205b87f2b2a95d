"""The numbers of an episode after each step: reward by term, value, distances, DCPA and TCPA.

They follow from the states, the actions and the Q-values alone, so an episode that is still being sailed
has them too.
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
# What people call the amounts of `Reward`; one of your own goes by its name.
TERMS = {"goal": "goal", "collision": "collision", "k1": "distance", "k2": "deviation"}


@dataclass(frozen=True, eq=False)
class Telemetry:
    """An episode so far, of T steps and K target ships; metres, seconds, radians.

    `states` [T + 1, 4] and `ships` [T + 1, K, 2] say where everybody was; `actions` [T] and `q_values` [T, A]
    (None where the policy has none) what was done there. After each step: `terms` (name to [T + 1]) and
    `total` [T + 1] the return so far; `goal_distance` [T + 1]; `apart` [T + 1, K] the distance of each ship,
    `closest` [T + 1, K] the least so far, within steps too; `dcpa` and `tcpa` [T + 1, K] as predicted from
    the courses and speeds of that moment. `outcome` is None while the episode is being sailed.
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
        """Count the steps sailed."""
        return len(self.actions)

    def between(self, position: float) -> tuple[Numbers, Numbers]:
        """Find own ship (x, y, heading) [3] and the target ships [K, 2] at a step or between two.

        Everybody moves on straight lines within a step. Own ship's course changes at once as a step begins;
        here it turns in the course of the step, for the eye.
        """
        position = min(max(position, 0.0), float(self.steps))
        before = min(int(position), max(0, self.steps - 1))
        after, share = min(before + 1, self.steps), position - before
        own = (1 - share) * self.states[before, :3] + share * self.states[after, :3]
        return own, (1 - share) * self.ships[before] + share * self.ships[after]

    def action(self, step: int) -> int | None:
        """Give the action that is taken now, None after the last."""
        return int(self.actions[step]) if step < self.steps else None

    def q(self, step: int) -> Numbers | None:
        """Give the Q-values of all actions [A], None where there are none."""
        return None if self.q_values is None or step >= len(self.q_values) else self.q_values[step]


def split(q: Numbers) -> tuple[float, Numbers]:
    """Split Q-values [..., A] into the value and the advantage of each action.

    The dueling network subtracts the mean of its advantages, so that the mean of Q is the value.
    """
    value = q.mean(-1, keepdims=True)
    return value[..., 0], q - value


def of_episode(case: Case, world: World, episode: Episode) -> Telemetry:
    """Measure a whole episode."""
    return measure(case, world, episode.states, episode.actions, episode.q_values)


def measure(
    case: Case, world: World, states: Tensor, actions: Tensor, q_values: Tensor | None = None
) -> Telemetry:
    """Measure an episode so far, of T steps; T may be 0.

    Args:
        case: where it is sailed.
        world: its physics and reward.
        states: float [T + 1, 4].
        actions: int64 [T].
        q_values: float [T, A], or more rows where those of the next step are known.
    """
    motion = Transition(case, world, torch.device("cpu"))
    after = motion(states[:-1], actions)
    ended = [bool(flag[-1:].any()) for flag in (after.goal, after.collision, after.truncated)]
    away = motion.away(states)
    within = torch.cat((torch.linalg.vector_norm(away[:1], dim=-1), closest_approach(away[:-1], away[1:])))
    own_velocity = speeds(world, actions)[:, None] * unit_vector(states[:, HEADING])
    dcpa, tcpa = predicted_approach(away, motion.ship_velocity - own_velocity[:, None])
    paid = rewards_by_term(case, world, states, actions)
    return Telemetry(
        case=case,
        world=world,
        states=array(states),
        ships=array(away + states[:, None, :2]),
        actions=actions.cpu().numpy().astype(np.int64),
        q_values=None if q_values is None else array(q_values),
        terms={name: summed(rewards) for name, rewards in paid.items()},
        total=summed(after.reward),
        goal_distance=array(motion.goal_distance(states)),
        apart=array(torch.linalg.vector_norm(away, dim=-1)),
        closest=array(within.cummin(0).values if within.numel() else within),
        dcpa=array(dcpa),
        tcpa=array(tcpa),
        outcome=outcome(*ended[:2]) if any(ended) else None,
    )


def speeds(world: World, actions: Tensor) -> Tensor:
    """Find own ship's speed at each state, [T] to [T + 1]: of the last action; at the start, of the first.

    Before the first action the ship lies still.
    """
    table = torch.tensor(world.actions)[:, 0]
    sailed = table[actions]
    return torch.cat((sailed[:1] if len(sailed) else torch.zeros(1), sailed))


def rewards_by_term(case: Case, world: World, states: Tensor, actions: Tensor) -> dict[str, Tensor]:
    """Compute what each term paid, name to float [T]: by the formula with all other amounts zero."""
    amounts = [field.name for field in fields(Reward) if not re.fullmatch(r"w\d", field.name)]
    paid = {}
    for name in amounts:
        others: dict[str, Any] = {other: 0.0 for other in amounts if other != name}
        alone = replace(world, reward=replace(world.reward, **others))
        step = Transition(case, alone, torch.device("cpu"))
        paid[TERMS.get(name, name)] = step(states[:-1], actions).reward
    return paid


def summed(rewards: Tensor) -> Numbers:
    """Sum up from 0 on: [T] to [T + 1]."""
    return np.concatenate(([0.0], rewards.double().cumsum(0).numpy()))


def array(values: Tensor) -> Numbers:
    """Copy a tensor as float64."""
    return values.detach().double().cpu().numpy()


def nearest_danger(telemetry: Telemetry, step: int) -> list[bool]:
    """Tell for each ship whether it is on its way into the safe circle, if all keep course and speed."""
    safe = telemetry.world.safe_distance
    return [
        bool(time > 0 and apart < safe and math.isfinite(apart))
        for apart, time in zip(telemetry.dcpa[step], telemetry.tcpa[step], strict=True)
    ]
