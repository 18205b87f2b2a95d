"""Compare NTNU's reading of the 22 Imazu problems with that of conf/suite/imazu.yaml, a row for each problem.

    python examples/imazu_two_readings.py outputs/ntnu_imazu

The folder holds `imazu01.yaml` to `imazu22.yaml` of NTNU's colav_simulator (scenarios/imazu_cases).
"""

from __future__ import annotations

import sys
from itertools import permutations
from typing import NamedTuple

import torch

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.foreign.suites import load_suite
from ship_trl.sim.cases import Case, load_world
from ship_trl.sim.encounter import Encounter, relative_motion
from ship_trl.sim.state import initial_state
from ship_trl.view.pages import encounter_classes


class Target(NamedTuple):
    """A target ship seen from own ship: degrees clockwise from its bow, shares of its speed, s, m."""

    bearing: float
    course: float
    speed: float
    tcpa: float
    dcpa: float
    encounter: Encounter


def targets_of(case: Case, world: World) -> list[Target]:
    """Return the target ships of a case."""
    state = initial_state(case, world)
    motion, straight = relative_motion(state.double()), world.actions[world.straight_action][0]
    bearings, classes = torch.rad2deg(motion.bearing).tolist(), encounter_classes(state)
    courses = [(case.heading - ship.heading) % 360 for ship in case.target_ships]
    shares = [ship.speed / straight for ship in case.target_ships]
    columns = bearings, courses, shares, motion.tcpa.tolist(), motion.dcpa.tolist(), classes
    return [Target(*numbers) for numbers in zip(*columns, strict=True)]


def apart(one: Target, other: Target) -> float:
    """Return by how many degrees two target ships differ in bearing and course."""
    pairs = ((one.bearing, other.bearing), (one.course, other.course))
    return sum(abs((a - b + 180) % 360 - 180) for a, b in pairs)


def both(ours: list[Target], theirs: list[Target], name: str, form: str, alike: float) -> str:
    """Write a number of each ship in both readings, once where all are alike."""
    pairs = [(getattr(one, name), getattr(other, name)) for one, other in zip(ours, theirs, strict=True)]
    mine, other = (
        ", ".join(format(number, form) for number in column) for column in zip(*pairs, strict=True)
    )
    return mine if all(abs(one - two) < alike for one, two in pairs) else f"{mine} / {other}"


def main(folder: str) -> None:
    """Print the table, and what holds of all problems."""
    world = load_world()
    suites = [load_suite(name, world).cases for name in ("imazu", folder)]
    print("| problem | bearing | course | speed | meet after, s | their DCPA, m |\n|---|---|---|---|---|---|")
    same = 0
    for one, other in zip(*suites, strict=True):
        ours, found = targets_of(one, world), targets_of(other, world)
        assert len(ours) == len(found)
        theirs = list(min(permutations(found), key=lambda some: sum(map(apart, ours, some))))
        same += [ship.encounter for ship in ours] == [ship.encounter for ship in theirs]
        cells = [
            both(ours, theirs, *about)
            for about in (("bearing", ".0f", 0.5), ("course", ".0f", 0.5), ("speed", ".2g", 0.02))
        ]
        cells += [", ".join(f"{getattr(ship, name):.0f}" for ship in theirs) for name in ("tcpa", "dcpa")]
        print(f"| {one.name.removeprefix('imazu')} | {' | '.join(cells)} |")
    print(f"\nBefore a stroke is ours. In {same} of {len(suites[0])} problems the classes agree.")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "outputs/ntnu_imazu")
    except ConfigError as error:
        sys.exit(str(error))
