"""Motion of own ship and of the target ships (section 3.1, table 1)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ship_trl.config.world import GiveWay, World
from ship_trl.sim.encounter import must_give_way, relative_motion
from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.state import (
    GIVES_WAY,
    GIVING_WAY,
    HEADING,
    HOLDS_COURSE,
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SPEED,
    SPEED,
    STEP,
    YAW_RATE,
    goal,
    position,
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
        lagging = state[..., SPEED : YAW_RATE + 1] - rates
        rates, mean = rates + lagging * lags[0], rates + lagging * lags[1]
    speed, turn = mean.unbind(-1)
    heading = state[..., HEADING] + turn * dt
    place = position(state) + (speed * dt).unsqueeze(-1) * unit_vector(heading)
    own = torch.cat((heading[..., None], rates), dim=-1)
    step = torch.stack((state[..., STEP] + 1.0, state[..., SHIP_COUNT]), dim=-1)
    ships = target_ships(state)
    way = (ships[..., SHIP_SPEED] * dt).unsqueeze(-1) * unit_vector(ships[..., SHIP_HEADING])
    ships = torch.cat((ships[..., :2] + way, ships[..., 2:]), dim=-1)
    return torch.cat((place, own, goal(state), step, ships.flatten(-2)), dim=-1)


def give_way(state: Tensor, rule: GiveWay, dt: float) -> Tensor:
    """Return the states [..., S] after target ships that give way to own ship have turned to starboard.

    A ship begins where the rules ask for it, DCPA is below `rule.dcpa` and TCPA between 0 and `rule.tcpa`.
    Until the ships have passed, it turns in each step that begins with so small a DCPA.
    """
    behaviour = target_ships(state)[..., SHIP_BEHAVIOUR]
    reacts = behaviour != HOLDS_COURSE
    # Without a ship that reacts nothing changes. On a GPU the check would wait for all earlier operations.
    if state.device.type == "cpu" and not bool(reacts.any()):
        return state
    motion = relative_motion(state)
    is_near = motion.dcpa < rule.dcpa
    begins = must_give_way(motion.aspect, motion.bearing) & is_near & (motion.tcpa <= rule.tcpa)
    is_giving = reacts & (motion.tcpa > 0) & (begins | (behaviour == GIVING_WAY))
    after = state.clone()
    ships = target_ships(after)
    ships[..., SHIP_HEADING] -= rule.turn * dt * (is_giving & is_near)
    now = torch.full_like(behaviour, GIVES_WAY).masked_fill(is_giving, GIVING_WAY)
    ships[..., SHIP_BEHAVIOUR] = torch.where(reacts, now, behaviour)
    return after
