"""Motion of own ship and of the target ships (section 3.1, table 1)."""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.sim.geometry import unit_vector
from ship_trl.sim.state import (
    HEADING,
    SHIP_COUNT,
    SHIP_HEADING,
    SHIP_SPEED,
    STEP,
    goal,
    position,
    target_ships,
)


def advance(state: Tensor, action: Tensor, actions: Tensor, dt: float) -> Tensor:
    """Return the states [..., S] after one action each: own ship turns, then moves; target ships move.

    Table 1 does not say whether the turn or the move comes first; this order is our choice.

    Args:
        state: states [..., S].
        action: indices into `actions`, int64 [...].
        actions: speed (m/s) and rate of turn (rad/s) of each action, [A, 2].
        dt: length of a step in seconds.
    """
    speed, turn = actions[action].unbind(-1)
    heading = state[..., HEADING] + turn * dt
    place = position(state) + (speed * dt).unsqueeze(-1) * unit_vector(heading)
    own = torch.stack((heading, speed, turn), dim=-1)
    step = torch.stack((state[..., STEP] + 1.0, state[..., SHIP_COUNT]), dim=-1)
    ships = target_ships(state)
    way = (ships[..., SHIP_SPEED] * dt).unsqueeze(-1) * unit_vector(ships[..., SHIP_HEADING])
    ships = torch.cat((ships[..., :2] + way, ships[..., 2:]), dim=-1)
    return torch.cat((place, own, goal(state), step, ships.flatten(-2)), dim=-1)
