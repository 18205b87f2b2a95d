"""Draw random encounters: scenes whose target ships would pass near own ship if all kept their course.

The paths are laid through a meeting point on own ship's way, as by Waltz and Okhrin (2023, arXiv 2211.01004).
A ship is kept if it is in the class of encounter that was drawn for it. NumPy, as in `starts`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Traffic, World
from ship_trl.sim.encounter import Encounter, classify
from ship_trl.sim.state import (
    GIVES_WAY,
    GOAL_Y,
    HEADING,
    HOLDS_COURSE,
    OWN_SIZE,
    SHIP_COUNT,
    SHIP_SIZE,
    SPEED,
    state_size,
)

# Arrays of states [N, S], and of numbers by ship.
States = NDArray[np.float32]
Numbers = NDArray[np.float32]
# Ships that fail are drawn again, at most this often; so many are drawn for each that is needed.
MAX_DRAWS, CANDIDATES = 1000, 3
# Own ship begins as in the paper's cases: at the origin, heading north, with the goal 600 m ahead.
NORTH, WAY = math.pi / 2, 600.0
# A ship must have had its class of encounter for this long (s) when the episode begins.
CLASS_SECONDS = 3.0
# Uniform numbers that a candidate takes.
DRAWS = 7


@dataclass(frozen=True)
class Band:
    """What target ships of a class are drawn from.

    `courses` are relative to own ship's, in degrees; `sides` their two equally likely signs, positive
    counter-clockwise; `speeds` are shares of own ship's speed, None stands for a bound of the traffic.
    """

    courses: tuple[float, float]
    sides: tuple[int, int]
    speeds: tuple[float | None, float | None] = (None, None)


BANDS = {
    Encounter.HEAD_ON: Band((175, 180), (1, -1)),
    # A ship from starboard heads to port.
    Encounter.GIVE_WAY: Band((10, 175), (1, 1)),
    Encounter.STAND_ON: Band((10, 175), (-1, -1)),
    Encounter.OVERTAKING: Band((0, 65), (1, -1), (None, 0.8)),
    # Only a faster ship comes up from behind.
    Encounter.OVERTAKEN: Band((0, 65), (1, -1), (1.2, 1.5)),
}


class TrafficStarts:
    """Draws initial states of random encounters. All random numbers are those of the generator passed in.

    Args:
        traffic: how many ships, of which classes, how fast, how near.
        world: own ship's speed.

    Attributes:
        states: an initial state without target ships, float32 [1, S].
    """

    def __init__(self, traffic: Traffic, world: World) -> None:
        self.traffic, self.places = traffic, len(traffic.ships) - 1
        self.speed = world.actions[world.straight_action][0]
        self.states = torch.zeros(1, state_size(self.places), device="cpu")
        for column, value in ((HEADING, NORTH), (SPEED, self.speed), (GOAL_Y, WAY)):
            self.states[0, column] = value
        classes = [Encounter[one.name.upper()] for one in traffic.classes]
        self._classes = np.array(classes)
        bands = [[*BANDS[one].courses, *BANDS[one].sides, *self._speeds(one)] for one in classes]
        self._bands = np.array(bands, np.float32)
        self._shares = np.cumsum(traffic.ships) / sum(traffic.ships)

    def _speeds(self, encounter: Encounter) -> list[float]:
        """Return the least and the greatest speed (m/s) of target ships of a class."""
        ends = zip(BANDS[encounter].speeds, self.traffic.speeds, strict=True)
        return sorted(bound if share is None else share * self.speed for share, bound in ends)

    def sample(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S], as `draw`."""
        return torch.from_numpy(self.draw(count, generator))

    # There are no cases to take in turn.
    balanced = sample

    def draw(self, count: int, generator: Generator) -> States:
        """Return initial states [count, S].

        Raises:
            ConfigError: too few ships keep the traffic's bounds.
        """
        states: States = self.states.numpy().repeat(count, 0)
        ships = np.searchsorted(self._shares, uniform((count,), generator), side="right")
        ships = ships.clip(max=self.places)
        states[:, SHIP_COUNT] = ships
        needed = (np.arange(self.places) < ships[:, None]).ravel().nonzero()[0]
        found = np.zeros((count * self.places, SHIP_SIZE), np.float32)
        for _ in range(MAX_DRAWS):
            if not needed.size:
                states[:, OWN_SIZE:] = found.reshape(count, -1)
                return states
            drawn, is_valid = self._draw_ships(len(needed) * CANDIDATES, generator)
            choices = is_valid.reshape(-1, CANDIDATES)
            first = choices.argmax(1) + CANDIDATES * np.arange(len(needed))
            is_found = choices.any(1)
            found[needed[is_found]] = drawn[first[is_found]]
            needed = needed[~is_found]
        raise ConfigError("suite: traffic: nearly no ship keeps these bounds; allowed: wider ones")

    def _draw_ships(self, count: int, generator: Generator) -> tuple[Numbers, NDArray[np.bool_]]:
        """Draw ships [N, SHIP_SIZE], and say which keep the bounds and are in their class [N]."""
        traffic = self.traffic
        share = uniform((DRAWS, count), generator)
        kind = (share[0] * len(self._classes)).astype(np.int64)
        near, far, one, other, slow, fast = self._bands[kind].T
        heading = NORTH + np.where(share[1] < 0.5, one, other) * np.radians(near + (far - near) * share[2])
        speed = slow + (fast - slow) * share[3]
        first, last = traffic.meeting
        seconds = WAY * (first + (last - first) * share[4]) / self.speed
        east, north = speed * np.cos(heading), speed * np.sin(heading) - self.speed
        # Own and target ship are `aside` from each other, across their relative way, after these seconds.
        aside = traffic.offset * (2 * share[5] - 1) / np.maximum(np.hypot(east, north), 1e-6)
        x, y = -east * seconds - north * aside, -north * seconds + east * aside
        distance = np.hypot(x, y)
        nearest, farthest = traffic.distance
        is_valid = (distance >= nearest) & (distance <= farthest)
        for ago in (0.0, CLASS_SECONDS):
            direction = np.arctan2(y - north * ago, x - east * ago)
            bearing, aspect = wrap(NORTH - direction), wrap(heading - direction - math.pi)
            is_valid &= classify(bearing, aspect) == self._classes[kind]
        behaviour = np.where(share[6] < traffic.reacting, GIVES_WAY, HOLDS_COURSE)
        return np.stack((x, y, heading, speed, behaviour), 1).astype(np.float32), is_valid


def uniform(shape: tuple[int, ...], generator: Generator) -> Numbers:
    """Draw numbers from 0 to 1. Filling an array costs half as much as `torch.rand`."""
    numbers = np.empty(shape, np.float32)
    torch.from_numpy(numbers).uniform_(generator=generator)
    return numbers


def wrap(angle: Numbers) -> Numbers:
    """Return angles (rad) in [-pi, pi)."""
    wrapped: Numbers = (angle + math.pi) % (2 * math.pi) - math.pi
    return wrapped
