"""Rotate and translate cases and states."""

import math
from dataclasses import replace

from ship_trl.sim.cases import Case


def move(point: list[float], degrees: float, shift: tuple[float, float]) -> list[float]:
    """Return a point rotated about the origin, then translated."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [point[0] * cos - point[1] * sin + shift[0], point[0] * sin + point[1] * cos + shift[1]]


def moved_case(case: Case, degrees: float, shift: tuple[float, float]) -> Case:
    """Return the case with everything in it rotated about the origin, then translated."""
    ships = []
    for ship in case.target_ships:
        x, y = move([ship.x, ship.y], degrees, shift)
        ships.append(replace(ship, x=x, y=y, heading=ship.heading + degrees))
    return replace(
        case,
        start=move(case.start, degrees, shift),
        goal=move(case.goal, degrees, shift),
        heading=case.heading + degrees,
        target_ships=ships,
    )
