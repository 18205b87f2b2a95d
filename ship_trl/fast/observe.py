"""`sim.vector.VectorObservation` as a compiled loop; tests compare the two.

Products are rounded before they are subtracted, so that equal velocities differ by exactly nothing.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.bounds import ENCOUNTER_NUMBERS, OWN_NUMBERS, SHIP_NUMBERS
from ship_trl.fast.jit import compiled
from ship_trl.fast.step import ONE, ZERO, Array
from ship_trl.sim import scene, state, vector

VIEW, TCPA, DCPA = np.float32(scene.VIEW_RADIUS), np.float32(vector.TCPA), np.float32(vector.DCPA)
MAX_SIZE, MIN_SPEED2 = np.float32(vector.MAX_SIZE), np.float32(vector.MIN_SPEED**2)
LEAST = np.float32(1e-6)
CLASSES = np.array(vector.CLASSES, np.int64)
ENCOUNTER = len(CLASSES)
SINCE, TURNED, LEFT = np.float32(vector.SINCE), np.float32(vector.TURNED), np.float32(vector.LEFT)
PI, CIRCLE = np.float32(math.pi), np.float32(2 * math.pi)


@compiled()
def observe_ship(row: Array, ship: int, cos: float, sin: float, max_speed: float, seen: Array) -> None:
    """Write the first numbers of a target ship into `seen`: its own begin at `ship` in a state, `row` [S].

    `cos` and `sin` are of own ship's heading.
    """
    east, north = row[ship + state.SHIP_X] - row[state.X], row[ship + state.SHIP_Y] - row[state.Y]
    speed, course = row[ship + state.SHIP_SPEED], row[ship + state.SHIP_HEADING]
    velocity_x = speed * math.cos(course) - row[state.SPEED] * cos
    velocity_y = speed * math.sin(course) - row[state.SPEED] * sin
    distance = math.sqrt(east * east + north * north)
    ahead, left = east * cos + north * sin, north * cos - east * sin
    onward, across = velocity_x * cos + velocity_y * sin, velocity_y * cos - velocity_x * sin
    speed2, away = max(onward * onward + across * across, MIN_SPEED2), max(distance, LEAST)
    time = -(ahead * onward + left * across) / (speed2 * TCPA)
    passing = (ahead * across - left * onward) / (math.sqrt(speed2) * DCPA)
    seen[0], seen[1] = ahead / VIEW, left / VIEW
    seen[2], seen[3] = onward / max_speed, across / max_speed
    seen[4], seen[5], seen[6] = distance / VIEW, left / away, ahead / away
    seen[7] = min(max(time, -MAX_SIZE), MAX_SIZE)
    seen[8] = min(max(passing, -MAX_SIZE), MAX_SIZE)


@compiled()
def observe_encounter(row: Array, ship: int, max_turn: float, dt: float, seen: Array) -> None:
    """Write the numbers of an encounter into `seen`; the ship's begin at `ship` in a state, `row` [S]."""
    kind = int(row[ship + state.SHIP_CLASS])
    is_on = np.float32(kind != 0)
    turned = row[state.HEADING] - row[ship + state.SHIP_ONSET_HEADING] + PI
    turned -= CIRCLE * np.float32(math.floor(turned / CIRCLE)) + PI
    seen[0] = row[ship + state.SHIP_TURN] / max_turn
    for k in range(ENCOUNTER):
        seen[1 + k] = np.float32(kind == CLASSES[k])
    seen[1 + ENCOUNTER] = (row[state.STEP] - row[ship + state.SHIP_ONSET]) * dt / SINCE * is_on
    seen[2 + ENCOUNTER] = turned / TURNED * is_on
    seen[3 + ENCOUNTER] = row[ship + state.SHIP_ACTION]


@compiled()
def observe(
    states: Array,
    max_speed: float,
    max_turn: float,
    dt: float,
    max_steps: float,
    ships: int,
    own: int,
    seen: Array,
) -> None:
    """Write what is observed of states [N, S] into `seen` [N, F]; the rest is of `VectorObservation`."""
    places, shown = (states.shape[1] - state.OWN_SIZE) // state.SHIP_SIZE, max(1, ships)
    size = (seen.shape[1] - own) // shown
    distance2 = np.empty(places, np.float32)
    for n in range(states.shape[0]):
        row, numbers = states[n], seen[n]
        cos, sin = math.cos(row[state.HEADING]), math.sin(row[state.HEADING])
        east, north = row[state.GOAL_X] - row[state.X], row[state.GOAL_Y] - row[state.Y]
        bearing = math.atan2(north, east) - row[state.HEADING]
        numbers[0] = math.sqrt(east * east + north * north) / VIEW
        numbers[1], numbers[2] = math.sin(bearing), math.cos(bearing)
        numbers[3], numbers[4] = row[state.SPEED] / max_speed, row[state.YAW_RATE] / max_turn
        if own > OWN_NUMBERS:
            numbers[OWN_NUMBERS] = min(max((max_steps - row[state.STEP]) * dt / LEFT, ZERO), ONE)
        numbers[own:] = ZERO
        count = min(places, int(row[state.SHIP_COUNT]))
        for k in range(count):
            ship = state.OWN_SIZE + state.SHIP_SIZE * k
            away_x, away_y = row[ship + state.SHIP_X] - row[state.X], row[ship + state.SHIP_Y] - row[state.Y]
            distance2[k] = away_x * away_x + away_y * away_y
        for k in range(count):
            nearer = 0
            for other in range(count):
                is_first = other < k and distance2[other] == distance2[k]
                nearer += int(distance2[other] < distance2[k] or is_first)
            if nearer < ships:
                first, ship = own + size * nearer, state.OWN_SIZE + state.SHIP_SIZE * k
                place = numbers[first : first + size]
                observe_ship(row, ship, cos, sin, max_speed, place)
                if size > SHIP_NUMBERS:
                    observe_encounter(row, ship, max_turn, dt, place[SHIP_NUMBERS - 1 :])
                place[size - 1] = ONE


class CompiledVector:
    """`VectorObservation` as a compiled loop on the CPU: `observe(state)` maps float32 [..., S] to [..., F].

    Of two ships whose distances differ by less than rounding, either may come first.
    """

    def __init__(self, reference: vector.VectorObservation) -> None:
        numbers = SHIP_NUMBERS + ENCOUNTER_NUMBERS * reference.encounters
        self._own, self._ships = OWN_NUMBERS + reference.encounters, reference.ships
        self.size = self._own + numbers * reference.ships
        units = reference.max_speed, reference.max_turn, reference.dt, reference.max_steps
        self._units = tuple(map(np.float32, units))

    def __call__(self, state: Tensor) -> Tensor:
        """Observe states float32 [..., S]; return float32 [..., F]."""
        rows = state.detach().reshape(-1, state.shape[-1]).contiguous()
        return torch.from_numpy(self.of_rows(rows.numpy())).view(*state.shape[:-1], self.size)

    def of_rows(self, states: Array) -> Array:
        """Observe states float32 [N, S]; return float32 [N, F]."""
        seen = np.empty((len(states), self.size), np.float32)
        observe(states, *self._units, self._ships, self._own, seen)
        return seen
