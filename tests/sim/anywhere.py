"""Hypothesis strategies for valid worlds, cases and actions."""

import math
from dataclasses import dataclass, replace

from hypothesis import strategies as st

from ship_trl.config.types import Reward, World
from ship_trl.sim.cases import Case, TargetShip, check_case

metres = st.floats(-500, 500)
degrees = st.floats(-180, 180)
# m/s and rad/s. Speeds are positive, because a world that only goes astern reaches no goal.
speeds, turns = st.floats(1, 20), st.floats(-0.15, 0.15)
# Seconds.
lags = st.just(0.0) | st.floats(0.1, 10)


@dataclass
class Scenario:
    """A case in a world, the actions of two own ships, and the time (s) of speed vectors in the picture."""

    world: World
    case: Case
    actions: list[int]
    other_actions: list[int]
    vector_time: float


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Draw a world of realistic size, with random actions, step, radii, lags and reward."""
    count = draw(st.integers(2, 8))
    weight = st.floats(-2, 2)
    return World(
        dt=draw(st.floats(0.5, 2)),
        max_steps=draw(st.integers(10, 40)),
        safe_distance=draw(st.floats(20, 80)),
        goal_distance=draw(st.floats(20, 80)),
        actions=[[draw(speeds), draw(turns)] for _ in range(count)],
        turn_time=draw(lags),
        speed_time=draw(lags),
        reward=Reward(*(draw(st.floats(-300, 300)) for _ in range(2)), *(draw(weight) for _ in range(6))),
    )


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Draw a scenario whose goal can be reached and whose ships start outside the safe distance."""
    world = draw(worlds())
    reach = max(speed for speed, _ in world.actions) * world.dt * world.max_steps
    start, share = [draw(metres), draw(metres)], draw(st.floats(0.05, 0.95))
    bearing, distance = math.radians(draw(degrees)), world.goal_distance + 1.0 + share * reach
    ships = []
    for _ in range(draw(st.integers(0, 3))):
        apart, direction = world.safe_distance + draw(st.floats(1, 300)), math.radians(draw(degrees))
        position = start[0] + apart * math.cos(direction), start[1] + apart * math.sin(direction)
        ships.append(TargetShip(*position, draw(degrees), draw(st.floats(0, 20))))
    goal = [start[0] + distance * math.cos(bearing), start[1] + distance * math.sin(bearing)]
    # Mostly towards the goal, so that some arrive.
    heading = math.degrees(bearing) + draw(st.floats(-40, 40))
    case = Case(start, heading, goal, "any", ships, "anywhere")
    check_case(case, world, "anywhere")
    steps = world.max_steps
    actions = st.lists(st.integers(0, len(world.actions) - 1), min_size=steps, max_size=steps)
    return Scenario(world, case, draw(actions), draw(actions), draw(st.sampled_from([0.0, 20.0])))


def mirrored(scenario: Scenario) -> Scenario:
    """Return the scenario mirrored about the x axis: port becomes starboard."""
    case, world = scenario.case, scenario.world
    ships = [replace(ship, y=-ship.y, heading=-ship.heading) for ship in case.target_ships]
    start, goal = ([x, -y] for x, y in (case.start, case.goal))
    mirror_image = replace(case, start=start, goal=goal, heading=-case.heading, target_ships=ships)
    actions = [[speed, -turn] for speed, turn in world.actions]
    return replace(scenario, case=mirror_image, world=replace(world, actions=actions))
