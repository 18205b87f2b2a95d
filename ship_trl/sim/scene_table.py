"""Read and write tables of fixed scenes with the planner's best plan of each. No torch.

A table stands beside the suite that names it (`scenes:`), as conf/suite/traffic_test.csv. Own ship begins at
the origin, heading north, with its goal 600 m ahead.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ship_trl.config.schema import read_as
from ship_trl.files.disk import atomic_write
from ship_trl.files.table import Cells, read_table
from ship_trl.sim.cases import Case, TargetShip

MAX_TABLE_BYTES, MAX_SHIPS = 10_000_000, 3
SHIP_COLUMNS = ("x", "y", "heading", "speed")
COLUMNS = (
    "name",
    "encounter",
    *(f"{column}{place}" for place in range(1, MAX_SHIPS + 1) for column in SHIP_COLUMNS),
    "best_return",
    "actions",
)


class Scene(NamedTuple):
    """A case, and its best known plan: undiscounted raw return and action indices."""

    case: Case
    best_return: float
    actions: list[int]


@cache
def read_scenes(path: Path) -> tuple[Scene, ...]:
    """Read a table of scenes.

    Raises:
        ConfigError: the file is missing, or is no such table.
    """
    return tuple(read_table(path, COLUMNS, _to_scene, MAX_TABLE_BYTES, "suite", "a table of scenes"))


def _to_scene(cells: Cells) -> Scene:
    where = f"row {cells['name']}: "
    ships = [
        read_as(
            TargetShip,
            {column: cells[f"{column}{place}"] for column in SHIP_COLUMNS},
            f"{where}ship {place}: ",
        )
        for place in range(1, MAX_SHIPS + 1)
        if any(cells[f"{column}{place}"] for column in SHIP_COLUMNS)
    ]
    case = Case([0.0, 0.0], 90.0, [0.0, 600.0], cells["encounter"], ships, cells["name"])
    best_return = read_as(float, cells["best_return"], where, key="best_return")
    return Scene(case, best_return, [int(digit) for digit in cells["actions"]])


def write_scenes(path: Path, scenes: Iterable[Scene]) -> None:
    """Write a table of scenes. The class of encounter is the case's `ideal_path`."""
    with atomic_write(path) as draft, draft.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for case, best_return, actions in scenes:
            ships = [(ship.x, ship.y, ship.heading, ship.speed) for ship in case.target_ships]
            numbers = [f"{number:.4f}" for ship in ships for number in ship]
            numbers += [""] * (len(SHIP_COLUMNS) * MAX_SHIPS - len(numbers))
            plan = "".join(map(str, actions))
            table.writerow([case.name, case.ideal_path, *numbers, f"{best_return:.3f}", plan])
