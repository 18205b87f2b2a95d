"""States of a case in which own ship is anywhere."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import Case
from ship_trl.sim.state import HEADING, OWN_SIZE, SHIP_SIZE, STEP, X, Y, initial_state


def scenes(case: Case, world: World, rows: Tensor | Sequence[Sequence[float]]) -> Tensor:
    """Return states [..., S] of a case.

    Args:
        case: goal and target ships.
        world: length of a step.
        rows: own ship's x and y (m) and heading (rad), and the step, [..., 4].
    """
    rows = torch.as_tensor(rows, dtype=torch.float32)
    states = initial_state(case, world).repeat(*rows.shape[:-1], 1)
    states[..., [X, Y, HEADING, STEP]] = rows
    for k, ship in enumerate(case.target_ships):
        course, way = math.radians(ship.heading), ship.speed * world.dt * rows[..., 3].double()
        first = OWN_SIZE + SHIP_SIZE * k
        states[..., first] = (ship.x + way * math.cos(course)).float()
        states[..., first + 1] = (ship.y + way * math.sin(course)).float()
    return states
