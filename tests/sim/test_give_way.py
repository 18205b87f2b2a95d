"""Target ships that give way by the rules, in torch and in the compiled loop."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from ship_trl.fast.worlds import make_step
from ship_trl.sim.cases import (
    BEHAVIOURS,
    GIVING_WAY,
    Behaviour,
    Suite,
    TargetShip,
    load_case,
    load_suite,
    load_world,
)
from ship_trl.sim.encounter import must_give_way, relative_motion
from ship_trl.sim.state import (
    HEADING,
    OWN_SIZE,
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    SHIP_HEADING,
    SPEED,
    first_case,
    initial_state,
    is_present,
    target_ships,
)

WORLD = load_world()
STRAIGHT = WORLD.straight_action
# x, y (m), heading (degrees) and speed (m/s) of target ships that meet own ship, which goes north at 15 m/s.
GIVE_WAY = {
    "head-on": (0.0, 600.0, 270.0, 15.0),
    "head-on, oblique": (-15.0, 550.0, 273.0, 15.0),
    "crossing": (-300.0, 300.0, 0.0, 15.0),
    "crossing from ahead": (-212.1, 512.1, -45.0, 15.0),
    "overtaking": (-20.0, -150.0, 88.0, 22.0),
}
STAND_ON = {
    "crossing": (300.0, 300.0, 180.0, 15.0),
    "overtaken": (0.0, 150.0, 90.0, 7.5),
}
# Passes at 300 m, or meets after 30 s.
NO_RISK = {"far": (300.0, 600.0, 270.0, 15.0), "later": (0.0, 1000.0, 270.0, 15.0)}


Ship = tuple[float, float, float, float]


def scene(*ships: Ship, behaviour: Behaviour = Behaviour.gives_way) -> Tensor:
    """Return the initial state [S]; own ship is at (0, 0) and heads north."""
    targets = [TargetShip(*ship, behaviour) for ship in ships]
    case = replace(load_case("1", WORLD), target_ships=targets)
    return initial_state(case, WORLD)


def passing(state: Tensor, fast: bool, steps: int = 60) -> tuple[float, Tensor]:
    """Return the least distance while own ship keeps its course, and the last state."""
    step, nearest, state = make_step(WORLD, fast=fast), math.inf, state[None]
    for _ in range(steps):
        after = step(state, torch.tensor([STRAIGHT]))
        state, nearest = after.state, min(nearest, float(after.min_distance))
    return nearest, state[0]


def course(state: Tensor) -> float:
    """Return the first target ship's heading in degrees."""
    return math.degrees(float(state[OWN_SIZE + SHIP_HEADING]))


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("name", GIVE_WAY)
def test_a_ship_that_must_give_way_passes_at_more_than_the_safe_distance(name: str, fast: bool) -> None:
    ship = GIVE_WAY[name]
    assert passing(scene(ship, behaviour=Behaviour.holds), fast)[0] < 0.5 * WORLD.safe_distance
    nearest, last = passing(scene(ship), fast)
    assert nearest > 1.5 * WORLD.safe_distance
    # It has turned to starboard, which is clockwise.
    assert 10 < ship[2] - course(last) < 60


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("ship", [*STAND_ON.values(), NO_RISK["far"]])
def test_a_ship_that_stands_on_or_passes_clear_holds_its_course(ship: Ship, fast: bool) -> None:
    both = Behaviour.gives_way, Behaviour.holds
    reacting, holding = (passing(scene(ship, behaviour=one), fast) for one in both)
    assert reacting[0] == holding[0]
    for each in (reacting, holding):
        target_ships(each[1])[..., SHIP_BEHAVIOUR] = 0
    assert torch.equal(reacting[1], holding[1])


@pytest.mark.parametrize("behaviour", Behaviour)
def test_a_state_keeps_a_ships_behaviour(behaviour: Behaviour) -> None:
    state = scene(*NO_RISK.values(), behaviour=behaviour)
    drawn = Suite("drawn", (), traffic=load_suite("traffic", WORLD).traffic)
    assert [ship.behaviour for ship in first_case(drawn, state).target_ships] == [behaviour] * 2
    target_ships(state)[..., SHIP_BEHAVIOUR] = GIVING_WAY
    assert first_case(drawn, state).target_ships[0].behaviour is Behaviour.gives_way


@pytest.mark.parametrize("fast", [False, True])
def test_a_ship_of_another_behaviour_does_not_give_way(fast: bool) -> None:
    state = scene(GIVE_WAY["crossing"])
    target_ships(state)[..., SHIP_BEHAVIOUR] = max(GIVING_WAY, *BEHAVIOURS.values()) + 1.0
    last = passing(state, fast, steps=5)[1]
    assert torch.equal(target_ships(last)[..., 2:], target_ships(state)[..., 2:])


def random_states(count: int, seed: int) -> Tensor:
    """Return states with three target ships of random behaviour; the last one may be absent."""
    generator = torch.Generator().manual_seed(seed)
    uniform = lambda *size: torch.rand(*size, generator=generator)  # noqa: E731
    state = scene(*[(0.0, 500.0, 0.0, 10.0)] * 3).repeat(count, 1)
    state[:, HEADING], state[:, SPEED] = 2 * math.pi * uniform(count), 7.5 + 7.5 * uniform(count)
    targets = target_ships(state)
    targets[..., :2] = 600 * uniform(count, 3, 2) - 300
    targets[..., 2], targets[..., 3] = 2 * math.pi * uniform(count, 3), 20 * uniform(count, 3)
    targets[..., 4] = torch.randint(3, (count, 3), generator=generator)  # holds, gives way, is giving way
    state[count // 2 :, SHIP_COUNT] = 2
    targets[count // 2 :, 2] = 0.0
    return state


def test_the_compiled_loop_turns_the_same_ships() -> None:
    state = random_states(5000, 1)
    action = torch.arange(5000) % 7
    slow, fast = (make_step(WORLD, fast=fast)(state, action).state for fast in (False, True))
    # Rounding decides which side of a bound a ship is on.
    motion, rule = relative_motion(state), WORLD.give_way
    on_edge = ((motion.dcpa - rule.dcpa).abs() < 0.01) | ((motion.tcpa - rule.tcpa).abs() < 1e-3)
    on_edge |= motion.tcpa.abs() < 1e-3
    for angle in (5.0, 67.5, 112.5, 180.0):
        for bearing in (motion.bearing, motion.aspect):
            on_edge |= (bearing.abs() - math.radians(angle)).abs() < 1e-4
    on_edge |= (motion.bearing.abs() < 1e-4) | (motion.aspect.abs() < 1e-4)
    clear = ~(on_edge & is_present(state)).any(-1)
    assert clear.float().mean() > 0.95
    torch.testing.assert_close(fast[clear], slow[clear], rtol=1e-6, atol=3e-4)
    turned = target_ships(slow)[..., 2] != target_ships(state)[..., 2]
    assert 100 < int(turned[clear].sum()) < int(clear.sum())


def test_of_two_ships_at_most_one_gives_way_unless_they_meet_head_on() -> None:
    angles = torch.linspace(-math.pi, math.pi, 721, dtype=torch.float64)[:-1]
    one, other = torch.meshgrid(angles, angles, indexing="ij")
    both = must_give_way(one, other) & must_give_way(other, one)
    head_on = (one.abs() <= math.radians(5)) & (other.abs() <= math.radians(5))
    assert torch.equal(both, head_on)
