"""Motion of own ship and of the target ships (section 3.1, table 1).

A state is a float tensor [..., 4]: x and y in metres, heading in radians, and the number of steps taken.
The state and the case determine everything else, because target ships hold course and speed.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.sim.geometry import unit_vector

X, Y, HEADING, STEP = range(4)
STATE_SIZE = 4


def advance(state: Tensor, action: Tensor, actions: Tensor, dt: float) -> Tensor:
    """Return the states [..., 4] after one action each: own ship turns, then moves.

    Table 1 leaves the order open; turning first is our choice. `action` int64 [...] indexes `actions` [A, 2]:
    speed (m/s) and rate of turn (rad/s). `dt` is the length of a step in seconds.
    """
    speed, turn = actions[action].unbind(-1)
    heading = state[..., HEADING] + turn * dt
    position = state[..., :2] + (speed * dt).unsqueeze(-1) * unit_vector(heading)
    step = state[..., STEP] + 1.0
    return torch.cat((position, heading.unsqueeze(-1), step.unsqueeze(-1)), dim=-1)


def target_positions(state: Tensor, start: Tensor, velocity: Tensor, dt: float) -> Tensor:
    """Return the positions [..., K, 2] in metres of K target ships at the time of each state [..., 4].

    They start at `start` [K, 2] in metres, and keep `velocity` [K, 2] in m/s. A step lasts `dt` seconds.
    """
    time = (state[..., STEP] * dt)[..., None, None]
    return start + time * velocity
