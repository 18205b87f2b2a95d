"""The numbers of an episode after each step: return by term, distances, DCPA and TCPA."""

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
from ship_trl.sim.geometry import closest_approach, predicted_approach, unit_vector
from ship_trl.sim.state import (
    HEADING,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SPEED,
    SHIP_Y,
    SPEED,
    goal_distance,
    relative_positions,
    select_ships,
    target_ships,
)
from ship_trl.sim.transition import Transition

Numbers = NDArray[np.float64]
# The amounts of `Reward` as people see them; any other amount keeps its own name.
TERMS = {"goal": "goal", "collision": "collision", "k1": "distance", "k2": "deviation"}
# Moments in a step at which `closest_places` looks.
MOMENTS_PER_STEP = 20


@dataclass(frozen=True, eq=False)
class Telemetry:
    """An episode so far, of T steps and K target ships, in metres, seconds and radians.

    Attributes:
        states: states, see `sim.state`, [T + 1, S].
        ships: positions of the target ships, [T + 1, K, 2].
        headings: headings of the target ships, [T + 1, K].
        speeds: speeds of the target ships, [T + 1, K].
        actions: indices of the actions taken, [T].
        q_values: of all actions, [T, A]; None if the policy has none.
        terms: return so far by reward term, each [T + 1].
        total: return so far, [T + 1].
        goal_distance: distance to the goal, [T + 1].
        apart: distance of each target ship, [T + 1, K].
        closest: least distance so far, between steps too, [T + 1, K].
        dcpa: predicted if all ships keep course and speed, [T + 1, K].
        tcpa: predicted likewise, [T + 1, K].
        outcome: goal, collision or timeout; None while the episode has not ended.
    """

    case: Case
    world: World
    states: Numbers
    ships: Numbers
    headings: Numbers
    speeds: Numbers
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
        """Number of steps so far."""
        return len(self.actions)

    def at(self, position: float) -> tuple[Numbers, Numbers]:
        """Return x, y, heading [3] of own ship and the target ships [K, 2] at a step or between two.

        The simulated ship turns at the start of a step; here it turns gradually, to look natural.
        """
        position = min(max(position, 0.0), float(self.steps))
        before = min(int(position), max(0, self.steps - 1))
        after, share = min(before + 1, self.steps), position - before
        own = (1 - share) * self.states[before, :3] + share * self.states[after, :3]
        return own, (1 - share) * self.ships[before] + share * self.ships[after]

    def closest_places(self) -> tuple[Numbers, Numbers] | None:
        """Return own ship [2] and the nearest ship [2] at the closest approach; None without target ships."""
        moments = [self.at(k / MOMENTS_PER_STEP) for k in range(MOMENTS_PER_STEP * self.steps + 1)]
        pairs = [(own[:2], ship) for own, ships in moments for ship in ships]
        return min(pairs, key=lambda pair: math.dist(*pair), default=None)

    def action(self, step: int) -> int | None:
        """Return the action taken at a step, or None after the last one."""
        return int(self.actions[step]) if step < self.steps else None

    def q(self, step: int) -> Numbers | None:
        """Return the Q-values of all actions [A] at a step, or None where there are none."""
        return None if self.q_values is None or step >= self.steps else self.q_values[step]

    def is_danger(self, step: int, ship: int) -> bool:
        """Return whether a ship will enter the safe distance if all keep course and speed."""
        return bool(self.tcpa[step, ship] > 0 and self.dcpa[step, ship] < self.world.safe_distance)


def measure_episode(case: Case, world: World, episode: Episode) -> Telemetry:
    """Measure a finished episode."""
    return measure(case, world, episode.states, episode.actions, episode.q_values)


def measure(
    case: Case, world: World, states: Tensor, actions: Tensor, q_values: Tensor | None = None
) -> Telemetry:
    """Measure an episode so far: states float [T + 1, S], actions int64 [T], q_values float [T, A]."""
    motion = Transition(world)
    # Of a suite, empty places for target ships are left out.
    states = select_ships(states, range(int(states[0, SHIP_COUNT])))
    after = motion(states[:-1], actions)
    goal, collision, truncated = (bool(f[-1:].any()) for f in (after.goal, after.collision, after.truncated))
    away = relative_positions(states)
    apart = torch.linalg.vector_norm(away, dim=-1)
    within = torch.cat((apart[:1], closest_approach(away[:-1], away[1:])))
    ships = target_ships(states)
    velocity = ships[..., SHIP_SPEED, None] * unit_vector(ships[..., SHIP_HEADING])
    velocity -= (states[:, SPEED, None] * unit_vector(states[:, HEADING]))[:, None]
    dcpa, tcpa = predicted_approach(away, velocity)
    return Telemetry(
        case=case,
        world=world,
        states=states.double().numpy(),
        ships=ships[..., : SHIP_Y + 1].double().numpy(),
        headings=ships[..., SHIP_HEADING].double().numpy(),
        speeds=ships[..., SHIP_SPEED].double().numpy(),
        actions=actions.cpu().numpy().astype(np.int64),
        q_values=None if q_values is None else q_values.double().numpy(),
        terms=_returns_by_term(world, states, actions),
        total=_return_so_far(after.reward),
        goal_distance=goal_distance(states).double().numpy(),
        apart=apart.double().numpy(),
        closest=(within.cummin(0).values if within.numel() else within).double().numpy(),
        dcpa=dcpa.double().numpy(),
        tcpa=tcpa.double().numpy(),
        outcome=outcome(goal, collision) if goal or collision or truncated else None,
    )


def _returns_by_term(world: World, states: Tensor, actions: Tensor) -> dict[str, Numbers]:
    """Compute the return so far by reward term: the return if all other amounts are zero."""
    amounts = [field.name for field in fields(Reward) if not re.fullmatch(r"w\d", field.name)]
    returns = {}
    for name in amounts:
        others: dict[str, Any] = {other: 0.0 for other in amounts if other != name}
        alone = Transition(replace(world, reward=replace(world.reward, **others)))
        returns[TERMS.get(name, name)] = _return_so_far(alone(states[:-1], actions).reward)
    return returns


def _return_so_far(rewards: Tensor) -> Numbers:
    """Sum rewards [T] to returns [T + 1] that begin with 0."""
    return np.concatenate(([0.0], rewards.double().cumsum(0).numpy()))
