"""The 22 Imazu problems: Table 4 of Sawada, Sato and Majima 2021 (doi 10.1007/s00773-020-00755-0).

In the printed table 8, 12 and 22 repeat 5, 6 and 15; here they are as drawn in the sources that follow
Imazu's figure.
"""

import math

from ship_trl.sim.cases import Case, TargetShip

# (course in degrees clockwise from own ship's, share of own ship's speed) of each target ship; * is slow.
SLOW = 0.7
PROBLEMS: tuple[tuple[tuple[float, float], ...], ...] = tuple(
    tuple((float(one.strip("*")), SLOW if one.endswith("*") else 1.0) for one in line.split())
    for line in (
        "180", "-90", "0*", "45",
        "180 -90", "-10 -45", "0* -45", "180 90", "-30 -90", "-90 15", "90 -30",
        "180 10 -45", "180 10 45", "-10 -45 -90", "0* -45 -90", "45* 90 -90", "0* 10 -45",
        "-135 -15 -30", "15 -15 -135", "0* -15 -90", "-15 15 -90", "0* -30 -90",
    )
)  # fmt: skip


def imazu(number: int, unit: float = 300.0, speed: float = 15.0) -> Case:
    """Return problem `number` from 1; own ship meets every target ship after `unit` metres."""
    ships = []
    for course, share in PROBLEMS[number - 1]:
        angle, way = math.radians(course), unit * share
        x, y = -way * math.sin(angle), unit - way * math.cos(angle)
        ships.append(TargetShip(x, y, 90.0 - course, speed * share))
    return Case([0.0, 0.0], 90.0, [0.0, 2 * unit], "none", ships, f"imazu-{number}")
