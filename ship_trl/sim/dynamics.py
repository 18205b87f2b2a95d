"""Motion of own ship and target ships (section 3.1, table 1).

A state is a float tensor [..., 4]: x, y (metres), heading (radians), step (count). Everything
else of the world follows from it and the case, because target ships hold course and speed.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.sim.geometry import unit_vector

X, Y, HEADING, STEP = range(4)
STATE_SIZE = 4


def advance(state: Tensor, action: Tensor, actions: Tensor, dt: float) -> Tensor:
    """One action: turn, then move (our reading of table 1).

    Shapes: state [..., 4], action [...] (index), actions [A, 2] (v in m/s, omega in rad/s).
    """
    speed, turn = actions[action].unbind(-1)
    heading = state[..., HEADING] + turn * dt
    position = state[..., :2] + (speed * dt).unsqueeze(-1) * unit_vector(heading)
    step = state[..., STEP] + 1.0
    return torch.cat((position, heading.unsqueeze(-1), step.unsqueeze(-1)), dim=-1)


def target_positions(state: Tensor, start: Tensor, velocity: Tensor, dt: float) -> Tensor:
    """Positions of the target ships at the state's time: [..., 4], [K, 2], [K, 2] to [..., K, 2]."""
    time = (state[..., STEP] * dt)[..., None, None]
    return start + time * velocity
