"""Similarity of two cases (equation 8 and section 4.1) and their distance (equation 7). No torch."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ship_trl.config.types import World
from ship_trl.sim.cases import Case

ALPHA = 1.0
BETA = 0.5
SAME_PATH = 1.0
SAME_SHIP = 0.5
KNOWN_DIRECTION = 0.2
NEW_DIRECTION = 0.4


@dataclass(frozen=True)
class Comparison:
    """One attribute of two cases, and its weights in what they share and in what differs (section 4.1)."""

    attribute: str
    common: float
    different: float


def compare(base: Case, target: Case) -> list[Comparison]:
    """Compare two cases attribute by attribute (section 4.1).

    The paper's rules cover ships that only the target has. Our choice: ships that only the base has count
    with the same weights, as equation 8 suggests ("different or missing").
    """
    same = base.ideal_path == target.ideal_path
    weights = (SAME_PATH, 0.0) if same else (0.0, SAME_PATH)
    comparisons = [Comparison("ideal path", *weights)]
    target_ships, base_ships = Counter(_ships(target)), Counter(_ships(base))
    common_ships = (target_ships & base_ships).total()
    comparisons += [Comparison("common target ship", SAME_SHIP, 0.0)] * common_ships
    for attribute, extra, other_ships in (
        ("extra target ship", target_ships - base_ships, base_ships),
        ("missing target ship", base_ships - target_ships, target_ships),
    ):
        known_directions = {heading for _, _, heading, _ in other_ships}
        for _, _, heading, _ in extra.elements():
            weight = KNOWN_DIRECTION if heading in known_directions else NEW_DIRECTION
            comparisons.append(Comparison(attribute, 0.0, weight))
    return comparisons


def _ships(case: Case) -> Iterator[tuple[float, float, float, float]]:
    """Yield the target ships, with positions relative to own ship's start."""
    x, y = case.start
    for ship in case.target_ships:
        yield ship.x - x, ship.y - y, ship.heading % 360.0, ship.speed


def describe_similarity(base: Case, target: Case) -> tuple[str, str]:
    """Describe what two cases share and how they differ, with weights, for example "1 ideal path" and "0"."""
    comparisons = compare(base, target)
    common = " + ".join(f"{one.common:g} {one.attribute}" for one in comparisons if one.common)
    different = " + ".join(f"{one.different:g} {one.attribute}" for one in comparisons if one.different)
    return common or "0", different or "0"


def similarity(base: Case, target: Case, _: World | None = None) -> float:
    """Compute equation 8, from 0 (nothing in common) to 1 (equal)."""
    comparisons = compare(base, target)
    common = ALPHA * sum(one.common for one in comparisons)
    different = BETA * sum(one.different for one in comparisons)
    return common / (common + different)


def characteristics(case: Case, world: World) -> dict[str, float]:
    """Compute the characteristics of equation 7, scaled to about 0 to 1; the paper leaves their choice open.

    DCPA, TCPA and relative course are those of the target ship with the smallest DCPA, if own ship keeps its
    course.
    """
    speed = max((v for v, turn in world.actions if turn == 0.0), default=world.actions[0][0])
    heading = math.radians(case.heading)
    velocity = speed * math.cos(heading), speed * math.sin(heading)
    nearest, when, course = math.inf, 0.0, heading
    for ship in case.target_ships:
        angle = math.radians(ship.heading)
        rx, ry = ship.x - case.start[0], ship.y - case.start[1]
        vx, vy = ship.speed * math.cos(angle) - velocity[0], ship.speed * math.sin(angle) - velocity[1]
        speed2 = vx * vx + vy * vy
        time = max(0.0, -(rx * vx + ry * vy) / speed2) if speed2 else 0.0
        apart = math.hypot(rx + vx * time, ry + vy * time)
        if apart < nearest:
            nearest, when, course = apart, time, angle
    danger = world.safe_distance / max(nearest, world.safe_distance)
    return {
        "target ships": len(case.target_ships) / 4.0,
        "goal distance": math.dist(case.start, case.goal) / 600.0,
        "danger": danger,
        "tcpa": min(when / world.max_steps / world.dt, 1.0),
        "relative course east": 0.5 * danger * math.cos(course - heading),
        "relative course north": 0.5 * danger * math.sin(course - heading),
    }


def distance(base: Case, target: Case, world: World) -> float:
    """Compute equation 7 as a Euclidean distance; 0 means equal cases."""
    a, b = characteristics(base, world), characteristics(target, world)
    return math.sqrt(sum((a[name] - b[name]) ** 2 for name in a))


def same_side(base: Case, target: Case, _: World | None = None) -> float:
    """Return 1 if the ideal paths pass the ships on the same side, or both go straight, else 0.

    A null for equation 8: finetuning does worse where paths pass an obstacle on different sides (Cao et al.,
    2021, transfer across homotopy classes).
    """
    one, other = (case.ideal_path.partition("-")[0] for case in (base, target))
    return float(one == other)


def ships_apart(base: Case, target: Case, _: World | None = None) -> float:
    """Return by how much the numbers of target ships differ: another null for equation 8."""
    return float(abs(len(base.target_ships) - len(target.target_ships)))


@dataclass(frozen=True)
class Measure:
    """A measure of similarity; if `nearer`, smaller values mean more similar.

    `value` takes base, target and world here, and what is known of both cases in `studies.sources`.
    """

    value: Callable[..., float]
    nearer: bool = False


# By their names on the command line.
MEASURES = {
    "similarity": Measure(similarity),
    "distance": Measure(distance, nearer=True),
    "side": Measure(same_side),
    "ships": Measure(ships_apart, nearer=True),
}
