"""Examine a policy in encounters with one target ship, spread evenly over all that a suite may draw.

Four numbers fix such an encounter: the target ship's course and speed, and when and how near it passes if
both ships keep their course (TCPA, signed DCPA). Bearing and range at the start follow from them. Scenes are
points of a Halton sequence, so that more scenes fill the gaps between fewer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from scipy.stats.qmc import Halton
from torch import Generator, Tensor

from ship_trl.config.types import Traffic, World
from ship_trl.fast.worlds import make_starts
from ship_trl.policies.manoeuvres import Manoeuvres
from ship_trl.policies.metrics import CLASS_NAMES
from ship_trl.policies.named import make_policy
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import Suite
from ship_trl.sim.encounter import Encounter, classify, relative_motion
from ship_trl.sim.starts import BANDS, GOAL_DISTANCE, NORTH
from ship_trl.sim.state import SHIP_HEADING, SHIP_SPEED, SHIP_X, SHIP_Y, SPEED, STEP, target_ships

Array = NDArray[Any]
# Scenes that are rolled out side by side, and points that are drawn at once.
BATCH, CHUNK = 1024, 65536
# Decimals in the table of a suite: a scene that is written and read again is the same scene.
DECIMALS = 4
# Cells: degrees of bearing and course, metres of range, ends of speed bands as shares of own ship's speed.
SECTOR, RING = 15, 100
SPEED_ENDS = (0.8, 1.2)
CELL = ("speed", "bearing", "course", "range")


@dataclass(frozen=True)
class Ends:
    """How N episodes end.

    Attributes:
        goal, collision: bool [N]; an episode with neither ends by the time limit.
        margin: what is left, as a share, of the safe distance or of the time; failures have 0 or less.
    """

    goal: Array
    collision: Array
    margin: Array


def with_ships(suite: Suite, count: int) -> Suite:
    """Return a suite of random encounters whose scenes all have `count` target ships."""
    assert suite.traffic is not None
    return replace(suite, traffic=replace(suite.traffic, ships=[0.0] * count + [1.0]))


def bounds_of(traffic: Traffic, speed: float) -> Array:
    """Return least and greatest course (rad, from own ship's), speed (m/s), TCPA (s) and DCPA (m), [2, 4].

    `speed` is own ship's. The speeds are those of all classes of encounter.
    """
    shares = [share for *_, ends in BANDS.values() for share in ends if share is not None]
    fastest = max(traffic.speeds[1], speed * max(shares))
    first, last = (GOAL_DISTANCE * share / speed for share in traffic.meeting)
    return np.array(
        [(-math.pi, traffic.speeds[0], first, -traffic.offset), (math.pi, fastest, last, traffic.offset)]
    )


def place_ships(states: Tensor, numbers: Array) -> None:
    """Write into states [N, S] the target ships of numbers [N, K, 4], see `bounds_of`."""
    heading, speed, seconds, dcpa = np.moveaxis(numbers + np.array((NORTH, 0, 0, 0)), -1, 0)
    east, north = speed * np.cos(heading), speed * np.sin(heading) - states[:, SPEED, None].numpy()
    # As `sim.starts.draw_ship` does.
    aside = dcpa / np.maximum(np.hypot(east, north), 1e-6)
    values = {
        SHIP_X: np.round(-east * seconds - north * aside, DECIMALS),
        SHIP_Y: np.round(-north * seconds + east * aside, DECIMALS),
        SHIP_HEADING: np.radians(np.round(np.degrees(heading), DECIMALS)),
        SHIP_SPEED: np.round(speed, DECIMALS),
    }
    ships = target_ships(states)
    for column, value in values.items():
        ships[..., column] = torch.from_numpy(value)


def read_ships(states: Tensor) -> Array:
    """Return the numbers [N, K, 4] with which `place_ships` writes the target ships of states [N, S]."""
    motion, ships = relative_motion(states.double()), target_ships(states).double()
    (x, y), (east, north) = motion.position.unbind(-1), motion.velocity.unbind(-1)
    dcpa = (east * y - north * x) / torch.hypot(east, north).clamp(min=1e-6)
    course = ships[..., SHIP_HEADING] - NORTH
    return torch.stack((course, ships[..., SHIP_SPEED], motion.tcpa, dcpa), -1).numpy()


def describe_ships(states: Tensor) -> tuple[Array, Array, Array]:
    """Return class of encounter, bearing (rad, clockwise) and range (m) of each ship, all [N, K]."""
    motion = relative_motion(states.double())
    return classify(motion.bearing, motion.aspect).numpy(), motion.bearing.numpy(), motion.distance.numpy()


def are_solvable(states: Tensor, world: World) -> Array:
    """Return in which states [N, S] a held manoeuvre reaches the goal, if target ships hold their course."""
    order = torch.arange(len(world.actions)).repeat(len(states), 1)
    chosen, _ = Manoeuvres(world).choose(states, order, torch.full((len(states), 3), -1))
    return (chosen >= 0).numpy()


def are_drawn(states: Tensor, traffic: Traffic) -> Array:
    """Return in which states [N, S] each ship's class of encounter and range are among the traffic's."""
    encounter, _, distance = describe_ships(states)
    classes = [Encounter[one.name.upper()] for one in traffic.classes]
    near, far = traffic.distance
    found: Array = np.isin(encounter, classes) & (distance >= near) & (distance <= far)
    return np.asarray(found.all(-1))


def to_sector(angle: Array) -> Array:
    """Return the middle (degrees, 0 to below 360) of the sector that an angle (rad) is in."""
    return (np.degrees(angle) / SECTOR).round().astype(int) % (360 // SECTOR) * SECTOR


def draw_exam(suite: Suite, world: World, count: int, seed: int = 0) -> tuple[Tensor, pd.DataFrame]:
    """Return `count` states of one target ship, and a row of a table for each.

    Ships start at a range that the suite allows, in one of its classes of encounter. The table has the class;
    the cell: band of speeds as shares of own ship's, and the middle of bearing and course (degrees, clockwise
    from own ship's heading) and of range (m); and whether the scene `is_solvable`. The seed is of what the
    four numbers leave open, such as which ships react.
    """
    suite = with_ships(suite, 1)
    traffic, own = suite.traffic, world.actions[world.straight_action][0]
    assert traffic is not None
    starts, points, found = make_starts(suite, world), Halton(4, scramble=False), list[Tensor]()
    (low, high), generator = bounds_of(traffic, own), Generator().manual_seed(seed)
    while sum(map(len, found)) < count:
        states = starts.sample(CHUNK, generator)
        place_ships(states, (low + (high - low) * points.random(CHUNK))[:, None])
        found.append(states[torch.from_numpy(are_drawn(states, traffic))])
    states = torch.cat(found)[:count]
    encounter, bearing, distance = (one[:, 0] for one in describe_ships(states))
    ship, ends = target_ships(states)[:, 0].double().numpy(), (low[1] / own, *SPEED_ENDS, high[1] / own)
    bands = np.array([f"{least:g} to {most:g}" for least, most in pairwise(ends)])
    cells = {
        "encounter": [CLASS_NAMES[one] for one in encounter],
        "speed": bands[np.searchsorted(SPEED_ENDS, ship[:, SHIP_SPEED] / own)],
        "bearing": to_sector(bearing),
        "course": to_sector(NORTH - ship[:, SHIP_HEADING]),
        "range": (distance // RING).astype(int) * RING + RING // 2,
        "is_solvable": np.concatenate([are_solvable(some, world) for some in states.split(CHUNK)]),
    }
    return states, pd.DataFrame(cells)


@torch.no_grad()
def run_scenes(
    entry: Entry, scenes: Tensor, seed: int = 0, show: Callable[[float], None] = lambda _: None
) -> Ends:
    """Roll out a policy once from each of the states [N, S]; `show` is given the share that is done."""
    total, count = len(scenes), min(BATCH, len(scenes))
    goal, collision, nearest, steps = np.zeros((4, total))
    # The environment reads `starts` at each reset: what stands there is a row's next scene.
    row, starts = torch.arange(count), scenes[:count].clone()
    env, policy = make_policy(entry, starts, seed)
    current = env.reset()
    starts[:] = scenes[(row + count) % total]
    while int(row.min()) < total:
        step, current = env.step_and_maybe_reset(policy(current))
        after = step["next"]
        ended = (after["done"].squeeze(-1) & (row < total)).nonzero().squeeze(-1)
        if not len(ended):
            continue
        which = row[ended].numpy()
        for array, key in ((goal, "goal"), (collision, "collision"), (nearest, "dcpa")):
            array[which] = after[key][ended, 0].numpy()
        steps[which] = after["state"][ended, STEP].numpy()
        row[ended] += count
        starts[ended] = scenes[(row[ended] + count) % total]
        show(min(1.0, float(row.min()) / total))
    safe, last = entry.world.safe_distance, entry.world.max_steps
    margin = np.minimum((nearest - safe) / safe, (last - steps) / last)
    return Ends(goal > 0, collision > 0, margin)
