"""One simulation step, a pure function of states and actions: motion (section 3.1, table 1) and outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from ship_trl.config.types import GiveWay, World
from ship_trl.sim import state as col
from ship_trl.sim.cases import GIVES_WAY, GIVING_WAY
from ship_trl.sim.encounter import must_give_way, relative_motion
from ship_trl.sim.geometry import closest_approach, unit_vector
from ship_trl.sim.reward import (
    MAX_SHIP_DISTANCE,
    POSITION_TOLERANCE,
    PaidStep,
    reward_amounts,
    reward_terms,
    step_reward,
)
from ship_trl.sim.state import (
    goal,
    goal_distance,
    goal_off_bow,
    is_present,
    position,
    relative_positions,
    target_ships,
)


def lag_shares(world: World) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the shares of a difference from the action's speed and rate of turn that lags leave.

    Both follow the action with a first-order lag: for the rate of turn this is Nomoto's model (1957), with
    r_wanted = K delta. The first pair (speed, rate of turn) is what is left at the end of a step, the second
    one is the mean over the step, which makes way and turn. Without a lag nothing is left.
    """
    times = world.speed_time, world.turn_time
    left = tuple(math.exp(-world.dt / time) if time else 0.0 for time in times)
    mean = tuple(time / world.dt * -math.expm1(-world.dt / time) if time else 0.0 for time in times)
    return (left[0], left[1]), (mean[0], mean[1])


def advance(state: Tensor, action: Tensor, actions: Tensor, dt: float, lags: Tensor | None = None) -> Tensor:
    """Return the states [..., S] after one action each: own ship turns, then moves; target ships move.

    Table 1 does not say whether the turn or the move comes first; this order is our choice.

    Args:
        state: states [..., S].
        action: indices into `actions`, int64 [...].
        actions: speed (m/s) and rate of turn (rad/s) of each action, [A, 2].
        dt: length of a step in seconds.
        lags: `lag_shares` [2, 2]; without it, speed and rate of turn are the action's at once.
    """
    rates = mean = actions[action]
    if lags is not None:
        lagging = state[..., col.SPEED : col.YAW_RATE + 1] - rates
        rates, mean = rates + lagging * lags[0], rates + lagging * lags[1]
    speed, turn = mean.unbind(-1)
    heading = state[..., col.HEADING] + turn * dt
    place = position(state) + (speed * dt).unsqueeze(-1) * unit_vector(heading)
    own = torch.cat((heading[..., None], rates), dim=-1)
    step = torch.stack((state[..., col.STEP] + 1.0, state[..., col.SHIP_COUNT]), dim=-1)
    ships = target_ships(state)
    way = (ships[..., col.SHIP_SPEED] * dt).unsqueeze(-1) * unit_vector(ships[..., col.SHIP_HEADING])
    ships = torch.cat((ships[..., :2] + way, ships[..., 2:]), dim=-1)
    return torch.cat((place, own, goal(state), step, ships.flatten(-2)), dim=-1)


def give_way(state: Tensor, rule: GiveWay, dt: float) -> Tensor:
    """Return the states [..., S] after target ships that give way to own ship have turned to starboard.

    A ship begins where the rules ask for it, DCPA is below `rule.dcpa` and TCPA between 0 and `rule.tcpa`.
    Until the ships have passed, it turns in each step that begins with so small a DCPA.
    """
    behaviour = target_ships(state)[..., col.SHIP_BEHAVIOUR]
    reacts = (behaviour == GIVES_WAY) | (behaviour == GIVING_WAY)
    # Without a ship that reacts nothing changes. On a GPU the check would wait for all earlier operations.
    if state.device.type == "cpu" and not bool(reacts.any()):
        return state
    motion = relative_motion(state)
    is_near = motion.dcpa < rule.dcpa
    begins = must_give_way(motion.aspect, motion.bearing) & is_near & (motion.tcpa <= rule.tcpa)
    is_giving = reacts & (motion.tcpa > 0) & (begins | (behaviour == GIVING_WAY))
    after = state.clone()
    ships = target_ships(after)
    ships[..., col.SHIP_HEADING] -= rule.turn * dt * (is_giving & is_near)
    now = torch.full_like(behaviour, GIVES_WAY).masked_fill(is_giving, GIVING_WAY)
    ships[..., col.SHIP_BEHAVIOUR] = torch.where(reacts, now, behaviour)
    return after


class Outcome(NamedTuple):
    """Results of one step of N ships.

    Attributes:
        state: states after the step, float32 [N, S].
        reward: raw rewards (equation 4), float32 [N].
        goal: whether the goal is reached without a collision, bool [N].
        collision: whether a target ship came inside the safe distance within the step, bool [N].
        truncated: whether the episode ends only because of the step limit, bool [N].
        min_distance: least distance (m) to a target ship within the step, float32 [N]; infinite without one.
    """

    state: Tensor
    reward: Tensor
    goal: Tensor
    collision: Tensor
    truncated: Tensor
    min_distance: Tensor


Step = Callable[[Tensor, Tensor], Outcome]


class Transition:
    """The simulation step, in torch on any device.

    `transition(state, action)` maps float32 [N, S] and int64 [N] to an `Outcome`. Every row may be another
    case.

    Attributes:
        actions: speed (m/s) and rate of turn (rad/s) of each action, [A, 2].
        lags: `lag_shares` [2, 2], or None without lags.
    """

    def __init__(self, world: World, device: torch.device | str = "cpu") -> None:
        self.world, self.amounts = world, reward_amounts(world.reward)
        self.actions = torch.tensor(world.actions, dtype=torch.float32, device=device)
        has_lags = world.turn_time > 0 or world.speed_time > 0
        self.lags = torch.tensor(lag_shares(world), device=device) if has_lags else None

    def __call__(self, state: Tensor, action: Tensor) -> Outcome:
        """Take one action with each ship: states float32 [N, S], action indices int64 [N]."""
        world = self.world
        state = give_way(state, world.give_way, world.dt)
        after = advance(state, action, self.actions, world.dt, self.lags)
        distances = closest_approach(relative_positions(state), relative_positions(after))
        distances = distances.masked_fill(~is_present(state), math.inf)
        nearest = distances.amin(-1) if distances.shape[-1] else torch.full_like(state[:, 0], math.inf)
        distance = goal_distance(after)
        collision = nearest < world.safe_distance
        # A collision takes precedence over reaching the goal in the same step.
        reached = (distance <= world.goal_distance + POSITION_TOLERANCE) & ~collision
        truncated = (after[:, col.STEP] >= world.max_steps) & ~reached & ~collision
        unpaid = Outcome(after, distance, reached, collision, truncated, nearest)
        return unpaid._replace(reward=step_reward(self.amounts, self._paid_step(action, unpaid)))

    def reward_terms(self, action: Tensor, outcome: Outcome) -> dict[str, Tensor]:
        """Return the raw rewards of steps by term, each [N], for the actions [N] and what they led to."""
        return reward_terms(self.amounts, self._paid_step(action, outcome))

    def _paid_step(self, action: Tensor, outcome: Outcome) -> PaidStep:
        """Return what steps are paid for."""
        state = outcome.state
        reached, collided = outcome.goal.to(state.dtype), outcome.collision.to(state.dtype)
        nearest = outcome.min_distance.clamp(max=MAX_SHIP_DISTANCE)
        speed, turn = self.actions[action].unbind(-1)
        return PaidStep(goal_distance(state), goal_off_bow(state), reached, collided, nearest, speed, turn)
