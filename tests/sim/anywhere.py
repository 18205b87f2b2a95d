"""Hypothesis strategies for valid worlds, cases and actions."""

import math
from dataclasses import dataclass, replace

from hypothesis import strategies as st

from ship_trl.config.types import Reward, World
from ship_trl.sim.cases import Case, TargetShip, check_case

tens = st.floats(-500, 500)
degrees = st.floats(-180, 180)
# m/s and rad/s. Speeds are positive, because a world that only goes astern reaches no goal.
speeds, turns = st.floats(1, 20), st.floats(-0.15, 0.15)
EDGE = 1.0


@dataclass
class Voyage:
    """A case in a world with the actions of one own ship, and those of a second one in `also`."""

    world: World
    case: Case
    actions: list[int]
    also: list[int]


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Draw a world of realistic size, with random actions, step, radii and reward."""
    count = draw(st.integers(2, 8))
    weight = st.floats(-2, 2)
    return World(
        dt=draw(st.floats(0.5, 2)),
        max_steps=draw(st.integers(10, 40)),
        safe_distance=draw(st.floats(20, 80)),
        goal_distance=draw(st.floats(20, 80)),
        actions=[[draw(speeds), draw(turns)] for _ in range(count)],
        reward=Reward(*(draw(st.floats(-300, 300)) for _ in range(2)), *(draw(weight) for _ in range(6))),
    )


@st.composite
def voyages(draw: st.DrawFn, most_ships: int = 3) -> Voyage:
    """Draw a voyage whose goal can be reached and whose ships start outside the safe distance."""
    world = draw(worlds())
    reach = max(speed for speed, _ in world.actions) * world.dt * world.max_steps
    start, way, bearing = [draw(tens), draw(tens)], draw(st.floats(0.05, 0.95)), math.radians(draw(degrees))
    far = world.goal_distance + EDGE + way * reach
    ships = []
    for _ in range(draw(st.integers(0, most_ships))):
        off, side = world.safe_distance + draw(st.floats(1, 300)), math.radians(draw(degrees))
        place = start[0] + off * math.cos(side), start[1] + off * math.sin(side)
        ships.append(TargetShip(*place, draw(degrees), draw(st.floats(0, 20))))
    goal = [start[0] + far * math.cos(bearing), start[1] + far * math.sin(bearing)]
    # Mostly towards the goal, so that some arrive.
    heading = math.degrees(bearing) + draw(st.floats(-40, 40))
    case = Case(start, heading, goal, "any", ships, "anywhere")
    check_case(case, world, "anywhere")
    course = st.lists(
        st.integers(0, len(world.actions) - 1), min_size=world.max_steps, max_size=world.max_steps
    )
    return Voyage(world, case, draw(course), draw(course))


def mirrored(voyage: Voyage) -> Voyage:
    """Return the voyage mirrored about the x axis: port becomes starboard."""
    case, world = voyage.case, voyage.world
    ships = [replace(ship, y=-ship.y, heading=-ship.heading) for ship in case.target_ships]
    flip = lambda place: [place[0], -place[1]]  # noqa: E731
    there = replace(
        case, start=flip(case.start), goal=flip(case.goal), heading=-case.heading, target_ships=ships
    )
    other = replace(world, actions=[[speed, -turn] for speed, turn in world.actions])
    return replace(voyage, case=there, world=other)
