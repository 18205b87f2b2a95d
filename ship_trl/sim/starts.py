"""Draw the initial states of episodes: a suite's cases, perturbed or not, or random encounters.

Environments reset a few rows at nearly every step, so this is NumPy: torch takes ten times as long on them.

Random encounters have target ships that would pass near own ship if all kept their course. The paths are
laid through a meeting point on own ship's way, as by Waltz and Okhrin (2023, arXiv 2211.01004). A ship is
kept if it is in the class of encounter that was drawn for it, and a scene if one of a fixed table of
manoeuvres brings own ship to its goal. A scene is a function of its seed alone. The functions up to
`draw_scenes` are loops over arrays and numbers, which can be compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Traffic, World
from ship_trl.sim import state as col
from ship_trl.sim.cases import GIVES_WAY, HOLDS_COURSE, Suite
from ship_trl.sim.encounter import Encounter, bearing_of, classify
from ship_trl.sim.state import (
    goal,
    goal_distance,
    goal_off_bow,
    initial_state,
    is_present,
    position,
    state_size,
    target_ships,
)
from ship_trl.sim.transition import Transition

Array = np.ndarray[Any, Any]
# Arrays: states [N, S], and indices of the suite's cases [N].
States = NDArray[np.float32]
Cases = NDArray[np.int64]
# Perturbed starts inside the safe distance or at the goal are drawn again, at most this often.
MAX_DRAWS = 1000
# Own ship begins as in the paper's cases: at the origin, heading north, with the goal 600 m ahead.
NORTH, GOAL_DISTANCE = math.pi / 2, 600.0
# A manoeuvre holds an action, sails straight on and then steers for the goal: steps of the first two.
HOLD, STRAIGHT = (11, 7, 16, 4, 2), (4, 0, 9, 15)
# A ship that fails is drawn again, and so is a scene, at most this often.
MAX_SHIPS, MAX_SCENES = 1000, 1000
# A ship must have had its class of encounter for this long (s) when the episode begins.
CLASS_SECONDS = 3.0
# What target ships of a class are drawn from: courses relative to own ship's in degrees, their two equally
# likely signs, positive counter-clockwise, and speeds as shares of own ship's; None is the traffic's bound.
BANDS: dict[Encounter, tuple[tuple[float, float], tuple[int, int], tuple[float | None, float | None]]] = {
    Encounter.HEAD_ON: ((175, 180), (1, -1), (None, None)),
    # A ship from starboard heads to port.
    Encounter.GIVE_WAY: ((10, 175), (1, 1), (None, None)),
    Encounter.STAND_ON: ((10, 175), (-1, -1), (None, None)),
    Encounter.OVERTAKING: ((0, 65), (1, -1), (None, 0.8)),
    # Only a faster ship comes up from behind.
    Encounter.OVERTAKEN: ((0, 65), (1, -1), (1.2, 1.5)),
}


def uniform(stream: Array) -> float:
    """Return the next number from 0 to 1 of a stream, uint64 [1]: SplitMix64 (Steele et al. 2014)."""
    stream[0] += np.uint64(0x9E3779B97F4A7C15)
    bits = stream[0]
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((bits ^ (bits >> np.uint64(31))) >> np.uint64(11)) / 2.0**53


def draw_ship(stream: Array, band: Array, kind: int, bounds: Array, ship: Array) -> bool:
    """Draw a target ship of a class into `ship` [SHIP_SIZE]; return whether it keeps the bounds.

    Args:
        stream: of random numbers, changed.
        band: least and greatest course (rad), the two signs of it, least and greatest speed (m/s).
        kind: the class of encounter.
        bounds: own ship's speed (m/s), then ends of the times to the meeting point (s), largest DCPA (m),
            ends of the distances (m), share of ships that react.
        ship: written.
    """
    own_speed, first, last, offset, nearest, farthest, reacting = bounds
    side = band[2] if uniform(stream) < 0.5 else band[3]
    heading = NORTH + side * (band[0] + (band[1] - band[0]) * uniform(stream))
    speed = band[4] + (band[5] - band[4]) * uniform(stream)
    seconds = first + (last - first) * uniform(stream)
    east, north = speed * math.cos(heading), speed * math.sin(heading) - own_speed
    # Own and target ship are `aside` from each other, across their relative way, after these seconds.
    aside = offset * (2 * uniform(stream) - 1) / max(math.sqrt(east * east + north * north), 1e-6)
    x, y = -east * seconds - north * aside, -north * seconds + east * aside
    ship[col.SHIP_X], ship[col.SHIP_Y], ship[col.SHIP_HEADING], ship[col.SHIP_SPEED] = x, y, heading, speed
    ship[col.SHIP_BEHAVIOUR] = GIVES_WAY if uniform(stream) < reacting else HOLDS_COURSE
    if not nearest * nearest <= x * x + y * y <= farthest * farthest:
        return False
    for ago in (0.0, CLASS_SECONDS):
        away_x, away_y = x - east * ago, y - north * ago
        bearing, aspect = bearing_of(away_x, away_y, NORTH), bearing_of(-away_x, -away_y, heading)
        if classify(bearing, aspect) != kind:
            return False
    return True


def keeps_clear(path: Array, ships: Array, dt: float, safe_distance: float) -> bool:
    """Return whether own ship keeps clear of ships [K, SHIP_SIZE] that hold course, on a path [T, 2] (m)."""
    safe2 = safe_distance * safe_distance
    for k in range(ships.shape[0]):
        ship = ships[k]
        way_x = ship[col.SHIP_SPEED] * dt * math.cos(ship[col.SHIP_HEADING])
        way_y = ship[col.SHIP_SPEED] * dt * math.sin(ship[col.SHIP_HEADING])
        x, y = ship[col.SHIP_X], ship[col.SHIP_Y]
        for t in range(path.shape[0]):
            after_x, after_y = ship[col.SHIP_X] + (t + 1) * way_x, ship[col.SHIP_Y] + (t + 1) * way_y
            after_x, after_y = after_x - path[t, 0], after_y - path[t, 1]
            moved_x, moved_y = after_x - x, after_y - y
            moved2 = moved_x * moved_x + moved_y * moved_y
            share = -(x * moved_x + y * moved_y)
            # Nearest within the step, as `geometry.closest_approach`, without a root.
            share = min(max(share / moved2, 0.0), 1.0) if moved2 > 0 else 0.0
            near_x, near_y = x + share * moved_x, y + share * moved_y
            if near_x * near_x + near_y * near_y < safe2:
                return False
            x, y = after_x, after_y
    return True


def draw_ships(stream: Array, drawn: Array, bands: Array, kinds: Array, bounds: Array, ships: Array) -> bool:
    """Draw ships [K, SHIP_SIZE] of the classes `drawn` [K], indices of `kinds`; return whether all are found.

    The other arguments are those of `draw_scenes`.
    """
    for k in range(drawn.shape[0]):
        is_found = False
        for _ in range(MAX_SHIPS):
            is_found = draw_ship(stream, bands[drawn[k]], kinds[drawn[k]], bounds, ships[k])
            if is_found:
                break
        if not is_found:
            return False
    return True


def is_solvable(paths: Array, lengths: Array, ships: Array, dt: float, safe_distance: float) -> bool:
    """Return whether a manoeuvre keeps clear of ships [K, SHIP_SIZE]; arguments as in `draw_scenes`."""
    for p in range(paths.shape[0]):  # noqa: SIM110 (numba compiles no generator)
        if keeps_clear(paths[p, : lengths[p]], ships, dt, safe_distance):
            return True
    return False


def draw_scenes(
    seeds: Array,
    shares: Array,
    kinds: Array,
    bands: Array,
    bounds: Array,
    paths: Array,
    lengths: Array,
    limits: Array,
    states: Array,
) -> bool:
    """Draw N scenes, each from its own seed; return whether all have been found.

    Args:
        seeds: uint64 [N].
        shares: of scenes with at most 0, 1, 2, ... target ships [K + 1].
        kinds: classes of encounter, equally likely, int64 [C].
        bands: what ships of each class are drawn from [C, 6], see `draw_ship`.
        bounds: see `draw_ship`.
        paths: own ship's positions (m) after each step of the manoeuvres of which one must succeed
            [P, T, 2].
        lengths: steps of each manoeuvre, int64 [P].
        limits: dt (s) and the safe distance (m).
        states: float32 [N, S] without ships; the ships are written.
    """
    dt, safe_distance = limits
    places, stream = shares.shape[0] - 1, np.empty(1, np.uint64)
    ships, drawn = np.zeros((places, col.SHIP_SIZE)), np.empty(places, np.int64)
    for n in range(seeds.shape[0]):
        stream[0] = seeds[n]
        share, count = uniform(stream), 0
        while count < places and share >= shares[count]:
            count += 1
        for k in range(count):
            drawn[k] = int(uniform(stream) * kinds.shape[0])
        for _ in range(MAX_SCENES):
            is_found = draw_ships(stream, drawn[:count], bands, kinds, bounds, ships)
            if not is_found:
                return False
            is_found = is_solvable(paths, lengths, ships[:count], dt, safe_distance)
            if is_found:
                break
        if not is_found:
            return False
        states[n, col.SHIP_COUNT] = count
        for k in range(count):
            for i in range(col.SHIP_SIZE):
                states[n, col.OWN_SIZE + col.SHIP_SIZE * k + i] = ships[k, i]
    return True


class TrafficStarts:
    """Draws initial states of random encounters. All random numbers are those of the generator passed in.

    Args:
        traffic: how many ships, of which classes, how fast, how near.
        world: own ship's dynamics, and the safe distance.
        scenes: `draw_scenes`, or a compiled one.

    Attributes:
        states: an initial state without target ships, float32 [1, S].

    Raises:
        ConfigError: in this world own ship could not reach its goal, or ships would start too near.
    """

    def __init__(self, traffic: Traffic, world: World, scenes: Callable[..., bool] = draw_scenes) -> None:
        self.traffic, self.places, self._draw_scenes = traffic, len(traffic.ships) - 1, scenes
        self.speed = world.actions[world.straight_action][0]
        self.states = torch.zeros(1, state_size(self.places), device="cpu")
        for column, value in ((col.HEADING, NORTH), (col.SPEED, self.speed), (col.GOAL_Y, GOAL_DISTANCE)):
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
        """Return what ships of a class are drawn from, as `draw_ship` takes it."""
        courses, sides, shares = BANDS[encounter]
        ends = zip(shares, self.traffic.speeds, strict=True)
        slow, fast = (bound if share is None else share * self.speed for share, bound in ends)
        if slow > fast:
            raise ConfigError(
                f"suite: traffic: speeds: must begin at {fast:g} m/s or less for the class "
                f"{encounter.name.lower()}, got {slow:g}"
            )
        return [*map(math.radians, courses), *sides, slow, fast]

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
            steering = (goal_off_bow(state)[:, None] - turns).abs().argmin(-1)
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
        """Return initial states [count, S].

        Raises:
            ConfigError: too few ships keep the traffic's bounds.
        """
        seeds = np.empty(count, np.int64)
        torch.from_numpy(seeds).random_(generator=generator)
        states: States = self.states.numpy().repeat(count, 0)
        with np.errstate(over="ignore"):  # SplitMix64 counts modulo 2**64
            are_found = self._draw_scenes(seeds.view(np.uint64), *self._constants, states)
        if not are_found:
            raise ConfigError(
                "suite: traffic: nearly no ship keeps these bounds, or own ship cannot avoid them; allowed: "
                "wider ones"
            )
        return torch.from_numpy(states)

    # There are no cases to take in turn.
    balanced = sample


class Starts:
    """Draws initial states of a suite. All its random numbers are those of the generator that is passed in.

    Args:
        suite: cases and perturbation.
        world: the actions, and the two distances that a start keeps.

    Attributes:
        states: initial states of the suite's cases, float32 [cases, S].
    """

    def __init__(self, suite: Suite, world: World) -> None:
        self.suite = suite
        places = max(len(case.target_ships) for case in suite.cases)
        self.states = torch.stack([initial_state(case, world, places) for case in suite.cases])
        self._is_perturbed = not suite.perturbation.is_none
        present = is_present(self.states)
        # The largest change of each number, and its least value.
        bounds, least = torch.zeros_like(self.states), torch.full_like(self.states[0], -math.inf)
        position(bounds)[:] = suite.perturbation.own_position
        bounds[:, col.HEADING] = math.radians(suite.perturbation.own_heading)
        target_ships(bounds)[..., : col.SHIP_Y + 1] = suite.perturbation.ship_position * present[..., None]
        target_ships(bounds)[..., col.SHIP_SPEED] = suite.perturbation.ship_speed * present
        target_ships(least)[..., col.SHIP_SPEED] = 0.0
        columns = torch.arange(self.states.shape[1], device="cpu")
        # What a case says. A seed's starts must not depend on what else a state holds.
        said = target_ships(columns)[:, : col.SHIP_BEHAVIOUR + 1].flatten()
        self._said = torch.cat((columns[: col.OWN_SIZE], said)).numpy()
        self._low, self._width = (self.states - bounds).numpy(), (2 * bounds).numpy()[:, self._said]
        self._least = least.numpy()[self._said]
        # Columns of goal and ships [1 + K, 2], and the distances to keep from them [cases, 1 + K].
        points = torch.cat((goal(columns)[None], target_ships(columns)[:, : col.SHIP_Y + 1]))
        keep = (
            torch.full((len(self.states), 1), world.goal_distance, device="cpu"),
            world.safe_distance * present,
        )
        self._points, self._keep = points.numpy(), torch.cat(keep, 1).numpy()
        # Starts are checked only where the bounds let a ship or the goal come too near.
        reach = math.sqrt(2) * (suite.perturbation.own_position + suite.perturbation.ship_position)
        cases = np.arange(len(self.states))
        self._may_fail = self._is_perturbed and self._find_invalid(self.states.numpy(), cases, reach).size > 0

    def sample(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S] of random cases. A fixed suite draws no numbers.

        Raises:
            ConfigError: too few perturbed starts keep the safe distance.
        """
        cases = np.zeros(count, np.int64)
        if len(self._low) > 1:
            torch.from_numpy(cases).random_(0, len(self._low), generator=generator)
        return torch.from_numpy(self._begin(cases, generator))

    def balanced(self, count: int, generator: Generator) -> Tensor:
        """Return initial states [count, S] of the cases in turn: row i is of case i modulo their number.

        Raises:
            ConfigError: as `sample`.
        """
        return torch.from_numpy(self._begin(np.arange(count) % len(self._low), generator))

    def _begin(self, cases: Cases, generator: Generator) -> States:
        """Return initial states [N, S] of cases [N]; draw invalid ones again."""
        states = self._perturb(cases, generator)
        if not self._may_fail:
            return states
        for _ in range(MAX_DRAWS):
            invalid = self._find_invalid(states, cases)
            if not invalid.size:
                return states
            states[invalid] = self._perturb(cases[invalid], generator)
        raise ConfigError(
            f"suite {self.suite.name}: perturbation: too large, as nearly every start is inside the safe "
            "distance or at the goal; allowed: smaller bounds"
        )

    def _perturb(self, cases: Cases, generator: Generator) -> States:
        """Return initial states [N, S] of cases [N], perturbed if the suite is."""
        states: States = self._low.take(cases, 0)
        if self._is_perturbed:
            # Filling an array costs half as much as `torch.rand`.
            share = np.empty((len(cases), len(self._said)), np.float32)
            torch.from_numpy(share).uniform_(generator=generator)
            drawn = states[:, self._said] + self._width.take(cases, 0) * share
            states[:, self._said] = np.maximum(drawn, self._least)
        return states

    def _find_invalid(self, states: States, cases: Cases, reach: float = 0.0) -> NDArray[np.int64]:
        """Return the rows nearer to a ship or the goal than allowed, by up to `reach` metres."""
        away = states[:, self._points] - states[:, None, col.X : col.Y + 1]
        distance = np.hypot(away[..., 0], away[..., 1])
        return (distance < self._keep.take(cases, 0) + reach).any(1).nonzero()[0]


def make_starts(
    suite: Suite, world: World, scenes: Callable[..., bool] = draw_scenes
) -> Starts | TrafficStarts:
    """Make what draws the initial states of a suite, random encounters by `scenes`."""
    return Starts(suite, world) if suite.traffic is None else TrafficStarts(suite.traffic, world, scenes)
