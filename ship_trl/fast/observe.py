"""`sim.vector.VectorObservation` as a compiled loop; tests compare the two.

Products are rounded before they are subtracted, so that equal velocities differ by exactly nothing.
"""

from __future__ import annotations

import math

import numpy as np

from ship_trl.config.bounds import OWN_NUMBERS, SHIP_NUMBERS
from ship_trl.fast.jit import compiled
from ship_trl.fast.step import ONE, ZERO, Array
from ship_trl.sim import scene, state, vector

VIEW, TCPA, DCPA = np.float32(scene.VIEW_RADIUS), np.float32(vector.TCPA), np.float32(vector.DCPA)
MAX_SIZE, MIN_SPEED2 = np.float32(vector.MAX_SIZE), np.float32(vector.MIN_SPEED**2)
LEAST = np.float32(1e-6)


@compiled()
def observe_ship(row: Array, ship: int, cos: float, sin: float, max_speed: float, seen: Array) -> None:
    """Write the numbers of a target ship into `seen` [10]: its own begin at `ship` in a state, `row` [S].

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
    seen[9] = ONE


@compiled()
def observe(states: Array, max_speed: float, max_turn: float, seen: Array) -> None:
    """Write what is observed of states [N, S] into `seen` [N, F]; the rest is of `VectorObservation`."""
    places = (states.shape[1] - state.OWN_SIZE) // state.SHIP_SIZE
    shown = (seen.shape[1] - OWN_NUMBERS) // SHIP_NUMBERS
    distance2 = np.empty(places, np.float32)
    for n in range(states.shape[0]):
        row, numbers = states[n], seen[n]
        cos, sin = math.cos(row[state.HEADING]), math.sin(row[state.HEADING])
        east, north = row[state.GOAL_X] - row[state.X], row[state.GOAL_Y] - row[state.Y]
        bearing = math.atan2(north, east) - row[state.HEADING]
        numbers[0] = math.sqrt(east * east + north * north) / VIEW
        numbers[1], numbers[2] = math.sin(bearing), math.cos(bearing)
        numbers[3], numbers[4] = row[state.SPEED] / max_speed, row[state.YAW_RATE] / max_turn
        numbers[OWN_NUMBERS:] = ZERO
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
            if nearer < shown:
                first = OWN_NUMBERS + SHIP_NUMBERS * nearer
                place = numbers[first : first + SHIP_NUMBERS]
                observe_ship(row, state.OWN_SIZE + state.SHIP_SIZE * k, cos, sin, max_speed, place)


class CompiledVector:
    """`VectorObservation` as a compiled loop on the CPU: `observe(states)` maps float32 [N, S] to [N, F].

    Of two ships whose distances differ by less than rounding, either may come first.
    """

    def __init__(self, reference: vector.VectorObservation) -> None:
        self.size = OWN_NUMBERS + SHIP_NUMBERS * reference.ships
        self._largest = np.float32(reference.max_speed), np.float32(reference.max_turn)

    def __call__(self, states: Array) -> Array:
        """Observe states float32 [N, S]; return float32 [N, F]."""
        seen = np.empty((len(states), self.size), np.float32)
        observe(states, *self._largest, seen)
        return seen
