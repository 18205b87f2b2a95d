"""The state of a scene: own ship, goal, step and target ships in one float32 row.

Step, reward and picture are functions of this row and of the world's constants, so the rows of a batch may
be different cases. Only this file says which number stands where. Metres, radians and seconds; x is east, y
is north; headings are counter-clockwise from east.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from ship_trl.config.types import World
from ship_trl.sim.cases import Case, Suite, TargetShip, behaviour_of
from ship_trl.sim.geometry import angle_off_bow

X, Y, HEADING, SPEED, YAW_RATE, GOAL_X, GOAL_Y, STEP, SHIP_COUNT = range(9)
OWN_SIZE = 9
# Behind own ship, goal, step and count: the numbers of each place for a target ship. A place at or beyond
# `SHIP_COUNT` is empty, and holds zeros. The second row is what has happened, see `sim.encounter.Tracker`:
# the ship's rate of turn (rad/s), the class of encounter that is locked, the step and own heading at its
# onset, and how much own ship has changed course and speed since then, from 0 to 1.
SHIP_X, SHIP_Y, SHIP_HEADING, SHIP_SPEED, SHIP_BEHAVIOUR = range(5)
SHIP_TURN, SHIP_CLASS, SHIP_ONSET, SHIP_ONSET_HEADING, SHIP_ACTION = range(5, 10)
SHIP_SIZE = 10


def state_size(places: int) -> int:
    """Return S, the length of a row with `places` places for target ships."""
    return OWN_SIZE + SHIP_SIZE * places


def mirrored_state(state: Tensor) -> Tensor:
    """Return states [..., S] with port and starboard exchanged: the scenes reflected about the x axis.

    Encounters stay what they were, though the rules know port from starboard.
    """
    signs = torch.ones(state.shape[-1], device=state.device)
    signs[[Y, HEADING, YAW_RATE, GOAL_Y]] = -1.0
    for number in (SHIP_Y, SHIP_HEADING, SHIP_TURN, SHIP_ONSET_HEADING):
        signs[OWN_SIZE + number :: SHIP_SIZE] = -1.0
    return state * signs


def initial_state(case: Case, world: World, places: int | None = None) -> Tensor:
    """Return the state [S] at the start of a case.

    Own ship has the speed of the world's straight action.

    Args:
        case: start, goal and target ships.
        world: the actions.
        places: places for target ships; by default as many as the case has.
    """
    ships = [
        number
        for ship in case.target_ships
        for number in (ship.x, ship.y, math.radians(ship.heading), ship.speed, ship.behaviour_number)
    ]
    count = len(case.target_ships)
    speed = world.actions[world.straight_action][0]
    own = [*case.start, math.radians(case.heading), speed, 0.0, *case.goal, 0.0, float(count)]
    row = torch.zeros(state_size(count if places is None else places), device="cpu")
    row[:OWN_SIZE] = torch.tensor(own, device="cpu")
    target_ships(row)[:count, : SHIP_BEHAVIOUR + 1] = torch.tensor(ships, device="cpu").view(
        count, SHIP_BEHAVIOUR + 1
    )
    return row


def first_case(suite: Suite, state: Tensor) -> Case:
    """Return the first case of a suite; without cases, a case that begins with a state [S]."""
    if suite.cases:
        return suite.cases[0]
    x, y, heading, _, _, goal_x, goal_y, *_ = state.tolist()
    ships = []
    for east, north, course, speed, behaviour, *_ in target_ships(state)[: int(state[SHIP_COUNT])].tolist():
        ships.append(TargetShip(east, north, math.degrees(course), speed, behaviour_of(behaviour)))
    return Case([x, y], math.degrees(heading), [goal_x, goal_y], "drawn", ships, suite.name)


def position(state: Tensor) -> Tensor:
    """Return own ship's positions (m) [..., 2] in states [..., S]."""
    return state[..., X : Y + 1]


def goal(state: Tensor) -> Tensor:
    """Return the positions (m) of the goal [..., 2] in states [..., S]."""
    return state[..., GOAL_X : GOAL_Y + 1]


def target_ships(state: Tensor) -> Tensor:
    """Return the places of target ships [..., K, SHIP_SIZE] in states [..., S], empty ones included."""
    return state[..., OWN_SIZE:].unflatten(-1, (-1, SHIP_SIZE))


def is_present(state: Tensor) -> Tensor:
    """Return which places hold a target ship, bool [..., K], for states [..., S]."""
    places = (state.shape[-1] - OWN_SIZE) // SHIP_SIZE
    return torch.arange(places, device=state.device) < state[..., SHIP_COUNT, None]


def goal_course(state: Tensor) -> Tensor:
    """Return the headings (rad) [...] from own ship to the goal in states [..., S]."""
    east, north = (goal(state) - position(state)).unbind(-1)
    return torch.atan2(north, east)


def goal_off_bow(state: Tensor) -> Tensor:
    """Return theta_2, the angles (rad) [...] from own ship's heading to the goal, in states [..., S]."""
    return angle_off_bow(position(state), state[..., HEADING], goal(state))


def goal_distance(state: Tensor) -> Tensor:
    """Return the distances (m) to the goal [...] for states [..., S]."""
    return torch.linalg.vector_norm(goal(state) - position(state), dim=-1)


def relative_positions(state: Tensor) -> Tensor:
    """Return the target ships' positions (m) relative to own ship, [..., K, 2], for states [..., S].

    Those of empty places mean nothing.
    """
    return target_ships(state)[..., : SHIP_Y + 1] - position(state)[..., None, :]


def select_ships(state: Tensor, places: Sequence[int]) -> Tensor:
    """Return states that keep only the target ships of some places, in ascending order."""
    own = state[..., :OWN_SIZE].clone()
    own[..., SHIP_COUNT] = is_present(state)[..., places].sum(-1)
    return torch.cat((own, target_ships(state)[..., places, :].flatten(-2)), -1)
