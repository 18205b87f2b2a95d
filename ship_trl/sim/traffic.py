"""Draw random encounters: scenes whose target ships would pass near own ship if all kept their course.

The paths are laid through a meeting point on own ship's way, as by Waltz and Okhrin (2023, arXiv 2211.01004).
A ship is kept if it is in the class of encounter that was drawn for it, and a scene if one of a fixed table
of manoeuvres brings own ship to its goal. A scene is a function of its seed alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Traffic, World
from ship_trl.sim.encounter import Encounter
from ship_trl.sim.geometry import angle_off_bow
from ship_trl.sim.state import (
    GOAL_Y,
    HEADING,
    SPEED,
    goal,
    goal_distance,
    position,
    state_size,
)
from ship_trl.sim.transition import Transition

# Arrays of states [N, S].
States = NDArray[np.float32]
# Own ship begins as in the paper's cases: at the origin, heading north, with the goal 600 m ahead.
NORTH, GOAL_DISTANCE = math.pi / 2, 600.0
# A manoeuvre holds an action, sails straight on and then steers for the goal: steps of the first two.
HOLD, STRAIGHT = (11, 7, 16, 4, 2), (4, 0, 9, 15)


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
        world: own ship's dynamics, and the safe distance.

    Attributes:
        states: an initial state without target ships, float32 [1, S].

    Raises:
        ConfigError: in this world own ship could not reach its goal, or ships would start too near.
    """

    def __init__(self, traffic: Traffic, world: World) -> None:
        self.traffic, self.places = traffic, len(traffic.ships) - 1
        self.speed = world.actions[world.straight_action][0]
        self.states = torch.zeros(1, state_size(self.places), device="cpu")
        for column, value in ((HEADING, NORTH), (SPEED, self.speed), (GOAL_Y, GOAL_DISTANCE)):
            self.states[0, column] = value
        if traffic.distance[0] < world.safe_distance:
            raise ConfigError(
                f"suite: traffic: distance: must begin at the safe distance of {world.safe_distance:g} m or "
                f"more, got {traffic.distance[0]:g}"
            )
        paths, lengths = self._manoeuvres(world)
        classes = [Encounter[one.name.upper()] for one in traffic.classes]
        bands = [self._band(one) for one in classes]
        seconds = [GOAL_DISTANCE * share / self.speed for share in traffic.meeting]
        bounds = [self.speed, *seconds, traffic.offset, *traffic.distance, traffic.reacting]
        self._constants = (
            np.cumsum(traffic.ships) / sum(traffic.ships),
            np.array(classes, np.int64),
            np.array(bands, np.float64),
            np.array(bounds, np.float64),
            paths,
            lengths,
            np.array([world.dt, world.safe_distance], np.float64),
        )

    def _band(self, encounter: Encounter) -> list[float]:
        """Return what ships of a class are drawn from, as `traffic_kernel.draw_ship` takes it."""
        band, ends = BANDS[encounter], zip(BANDS[encounter].speeds, self.traffic.speeds, strict=True)
        slow, fast = (bound if share is None else share * self.speed for share, bound in ends)
        if slow > fast:
            raise ConfigError(
                f"suite: traffic: speeds: must begin at {fast:g} m/s or less for the class "
                f"{encounter.name.lower()}, got {slow:g}"
            )
        return [*map(math.radians, band.courses), *band.sides, slow, fast]

    def _manoeuvres(self, world: World) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return own ship's places [P, T, 2] in manoeuvres that reach the goal, and their steps [P]."""
        transition, straight = Transition(world), world.straight_action
        evading = [k for k in range(len(world.actions)) if k != straight] or [straight]
        plans = torch.tensor(list(product(STRAIGHT, HOLD, evading)), device="cpu")
        after, hold, action = plans.unbind(1)
        turns = transition.actions[:, 1] * world.dt
        state, places = self.states.repeat(len(plans), 1), []
        arrival = torch.zeros(len(plans), dtype=torch.int64, device="cpu")
        for step in range(world.max_steps):
            off_bow = angle_off_bow(position(state), state[:, HEADING], goal(state))
            steering = (off_bow[:, None] - turns).abs().argmin(-1)
            chosen = torch.where(step < hold, action, torch.full_like(action, straight))
            chosen = torch.where(step < hold + after, chosen, steering)
            outcome = transition(state, chosen)
            state = outcome.state
            places.append(position(state))
            arrival[outcome.goal & (arrival == 0)] = step + 1
        found = (arrival > 0).nonzero().squeeze(-1)
        if not len(found) or float(goal_distance(self.states)) <= world.goal_distance:
            raise ConfigError(
                f"suite: traffic: the goal is {GOAL_DISTANCE:g} m away: own ship is there at once or never; "
                "allowed: world.goal_distance, world.max_steps and world.actions that let it arrive"
            )
        return torch.stack(places, 1)[found].double().numpy(), arrival[found].numpy()

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
        # Imported here: numba takes half a second.
        from ship_trl.sim.fast.traffic_kernel import draw_scenes

        seeds = np.empty(count, np.int64)
        torch.from_numpy(seeds).random_(generator=generator)
        states: States = self.states.numpy().repeat(count, 0)
        if not draw_scenes(seeds.view(np.uint64), *self._constants, states):
            raise ConfigError(
                "suite: traffic: nearly no ship keeps these bounds, or own ship cannot avoid them; allowed: "
                "wider ones"
            )
        return states
