"""Invariants in any world: an independent simulation, mirroring, rotation and translation, batching."""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.fast.step import CompiledStep
from ship_trl.fast.worlds import make_env, make_rasteriser
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.reward import POSITION_TOLERANCE
from ship_trl.sim.state import (
    SHIP_TURN,
    goal,
    goal_distance,
    initial_state,
    mirrored_state,
    relative_positions,
    target_ships,
)
from ship_trl.sim.transition import Transition
from tests.sim.anywhere import Scenario, mirrored, scenarios
from tests.sim.moving import moved_case
from tests.sim.pictures import compiled_difference
from tests.sim.scenes import scenes

Positions = NDArray[np.float64]
# Metres: error of 40 steps in float32, some hundred metres from the origin, against float64.
MAX_POSITION_ERROR = 0.02
# Maximum difference of pixel values, of 256, that rounding of positions may cause.
MAX_PIXEL_ERROR = 2


@dataclass
class Step:
    """Result of one step of the environment."""

    state: Tensor
    reward: float
    dcpa: float
    outcome: str
    pixels: Tensor


def rollout(scenario: Scenario) -> list[Step]:
    """Roll out the actions in the environment until the episode ends."""
    env, steps = (
        make_env(scenario.case, scenario.world, from_pixels=True, vector_time=scenario.vector_time),
        [],
    )
    step = env.reset()
    for action in scenario.actions:
        step = env.step(step.set("action", torch.tensor([action])))["next"]
        flags = {name: bool(step[name]) for name in ("collision", "goal", "truncated")}
        outcome = next((name for name, happened in flags.items() if happened), "")
        assert bool(step["done"]) == bool(outcome) and sum(flags.values()) <= 1
        numbers = float(step["reward"]), float(step["dcpa"])
        steps.append(Step(step["state"][0], *numbers, outcome, step["pixels"][0]))
        if outcome:
            break
    return steps


@dataclass
class Expected:
    """Own ship's position and distances after a step (m), and the goal's angle off the bow (rad)."""

    position: Positions
    to_goal: float
    off_bow: float
    ship_distance: float


def least_distance(before: Positions, after: Positions) -> float:
    """Return the least distance from the origin to points moving straight, [K, 2]; infinite if K is 0."""
    travel = after - before
    square = (travel * travel).sum(-1)
    share = np.clip(-(before * travel).sum(-1) / np.where(square > 0, square, 1), 0, 1)
    return float(np.hypot(*(before + share[:, None] * travel).T).min(initial=math.inf))


def follow(now: float, wanted: float, time: float, dt: float) -> tuple[float, float]:
    """Return a rate that follows another one with a lag, at the end of a step and as its mean."""
    if time == 0:
        return wanted, wanted
    left = math.exp(-dt / time)
    return wanted + (now - wanted) * left, wanted + (now - wanted) * (1 - left) * time / dt


def simulate(scenario: Scenario) -> list[Expected]:
    """Simulate in float64, independently of the environment."""
    case, world = scenario.case, scenario.world
    position, heading = np.array(case.start), math.radians(case.heading)
    ships = np.array([[s.x, s.y] for s in case.target_ships]).reshape(-1, 2)
    angles = [math.radians(s.heading) for s in case.target_ships]
    pairs = zip(case.target_ships, angles, strict=True)
    velocity = np.array([[s.speed * math.cos(a), s.speed * math.sin(a)] for s, a in pairs]).reshape(-1, 2)
    steps, speed, turn = [], world.actions[world.straight_action][0], 0.0
    for action in scenario.actions:
        speed, mean_speed = follow(speed, world.actions[action][0], world.speed_time, world.dt)
        turn, mean_turn = follow(turn, world.actions[action][1], world.turn_time, world.dt)
        heading += mean_turn * world.dt
        after = position + mean_speed * world.dt * np.array([math.cos(heading), math.sin(heading)])
        ships_after = ships + velocity * world.dt
        goal = np.array(case.goal) - after
        off_bow = math.remainder(math.atan2(goal[1], goal[0]) - heading, 2 * math.pi)
        ship_distance = least_distance(ships - position, ships_after - after)
        steps.append(Expected(after, math.hypot(*goal), off_bow, ship_distance))
        position, ships = after, ships_after
    return steps


def reward_error(now: Expected) -> float:
    """Bound the error of a reward: near the goal, a centimetre turns the line of sight noticeably."""
    degrees = math.degrees(MAX_POSITION_ERROR / max(now.to_goal, MAX_POSITION_ERROR))
    return 4 * (MAX_POSITION_ERROR + degrees + 0.05)


def outcome_of(scenario: Scenario, step: int, now: Expected) -> str | None:
    """Return how a step ends, or None if rounding decides."""
    world = scenario.world
    if abs(now.ship_distance - world.safe_distance) < MAX_POSITION_ERROR:
        return None
    if now.ship_distance < world.safe_distance:
        return "collision"
    if abs(now.to_goal - world.goal_distance - POSITION_TOLERANCE) < MAX_POSITION_ERROR:
        return None
    if now.to_goal < world.goal_distance:
        return "goal"
    return "truncated" if step + 1 >= world.max_steps else ""


@given(scenarios())
def test_the_environment_equals_an_independent_simulation(scenario: Scenario) -> None:
    dcpa, reward = math.inf, scenario.world.reward
    for step, (got, now) in enumerate(zip(rollout(scenario), simulate(scenario), strict=False)):
        dcpa = min(dcpa, now.ship_distance)
        assert got.state[:2].numpy() == pytest.approx(now.position, abs=MAX_POSITION_ERROR)
        assert got.dcpa == pytest.approx(dcpa, abs=MAX_POSITION_ERROR)
        outcome = outcome_of(scenario, step, now)
        if outcome is None:
            return
        assert got.outcome == outcome
        wanted = reward.w3 * reward.k1 * now.to_goal
        wanted += reward.w4 * reward.k2 * abs(math.degrees(now.off_bow))
        ends = {"goal": reward.w1 * reward.goal, "collision": reward.w2 * reward.collision}
        wanted += ends.get(outcome, 0.0)
        assert got.reward == pytest.approx(wanted, abs=reward_error(now), rel=1e-4)


@given(scenarios())
def test_the_mirrored_world_is_bit_identical(scenario: Scenario) -> None:
    """Mirror about the x axis, where sines change sign exactly: only the angle is rounded."""
    original, mirror_image = rollout(scenario), rollout(mirrored(scenario))
    assert [step.outcome for step in original] == [step.outcome for step in mirror_image]
    for one, other in zip(original, mirror_image, strict=True):
        assert torch.equal(*(placed(each) for each in (mirrored_state(one.state), other.state)))
        assert one.dcpa == other.dcpa
        assert other.reward == pytest.approx(one.reward, abs=1e-2, rel=1e-5)
        # Port and starboard change sides; the picture is rotated by a quarter turn, which is rounded.
        assert int((one.pixels.flip(-1).int() - other.pixels.int()).abs().max()) <= MAX_PIXEL_ERROR


def placed(state: Tensor) -> Tensor:
    """Return a state without its encounters: the rules know port from starboard."""
    state = state.clone()
    target_ships(state)[..., SHIP_TURN:] = 0
    return state


@given(scenarios(), st.floats(-180, 180), st.tuples(st.floats(-300, 300), st.floats(-300, 300)))
def test_a_rotated_and_translated_world_has_the_same_pictures_and_rewards(
    scenario: Scenario, degrees: float, shift: tuple[float, float]
) -> None:
    moved = replace(scenario, case=moved_case(scenario.case, degrees, shift))
    steps = zip(rollout(scenario), rollout(moved), simulate(scenario), strict=False)
    for step, (one, other, now) in enumerate(steps):
        if outcome_of(scenario, step, now) is None:
            return
        assert one.outcome == other.outcome
        assert other.dcpa == pytest.approx(one.dcpa, abs=2 * MAX_POSITION_ERROR)
        assert other.reward == pytest.approx(one.reward, abs=2 * reward_error(now), rel=1e-4)
        assert int((one.pixels.int() - other.pixels.int()).abs().max()) <= MAX_PIXEL_ERROR


@given(scenarios(), st.integers(2, 5))
@settings(max_examples=25)
def test_a_batch_is_bit_identical_to_its_ships_one_by_one(scenario: Scenario, count: int) -> None:
    make_env = partial(ShipEnv, from_pixels=True, colour=True, vector_time=scenario.vector_time)
    env, single = (make_env(scenario.case, scenario.world, n) for n in (count, 1))
    together, singles = env.reset(), [single.reset() for _ in range(count)]
    for first, other in list(zip(scenario.actions, scenario.other_actions, strict=True))[:8]:
        actions = torch.tensor(
            [first if n % 2 else (other + n) % len(scenario.world.actions) for n in range(count)]
        )
        stepped, together = env.step_and_maybe_reset(together.set("action", actions))
        for n in range(count):
            alone, singles[n] = single.step_and_maybe_reset(singles[n].set("action", actions[n : n + 1]))
            for key in ("state", "reward", "dcpa", "goal", "collision", "truncated", "done", "pixels"):
                assert torch.equal(stepped["next", key][n], alone["next", key][0]), key
            for key in ("state", "dcpa", "pixels"):
                assert torch.equal(together[key][n], singles[n][key][0]), key


@given(scenarios(), st.integers(0, 2**31))
@settings(max_examples=40)
def test_the_compiled_loops_equal_the_reference_in_any_world(scenario: Scenario, seed: int) -> None:
    generator, count, world = torch.Generator().manual_seed(seed), 400, scenario.world
    reference, start = Transition(world), initial_state(scenario.case, world)
    row = torch.rand(count, 4, generator=generator) * torch.tensor([1600.0, 1600.0, 6 * math.pi, 0.0])
    row[:, :2] += start[:2] - 800.0
    row[:, 3] = torch.randint(world.max_steps, (count,), generator=generator)
    # A quarter is near the goal, and a quarter near a ship, where outcomes change.
    spread = torch.randn(count, 2, generator=generator) * 40
    row[: count // 4, :2] = goal(start) + spread[: count // 4]
    state = scenes(scenario.case, world, row)
    if scenario.case.target_ships:
        near_ship = slice(count // 4, count // 2)
        state[near_ship, :2] += relative_positions(state)[near_ship, 0] + spread[near_ship]
    action = torch.randint(len(world.actions), (count,), generator=generator)
    wanted, got = reference(state, action), CompiledStep(reference)(state, action)
    torch.testing.assert_close(got.state, wanted.state, rtol=1e-6, atol=3e-4)
    torch.testing.assert_close(got.min_distance, wanted.min_distance, rtol=1e-5, atol=2e-3)
    on_edge = (wanted.min_distance - world.safe_distance).abs() < MAX_POSITION_ERROR
    to_circle = goal_distance(wanted.state) - world.goal_distance - POSITION_TOLERANCE
    on_edge |= to_circle.abs() < MAX_POSITION_ERROR
    for flag in ("goal", "collision", "truncated"):
        assert torch.equal(getattr(got, flag)[~on_edge], getattr(wanted, flag)[~on_edge]), flag
    torch.testing.assert_close(got.reward[~on_edge], wanted.reward[~on_edge], rtol=1e-4, atol=5e-2)
    draw = make_rasteriser(world, vector_time=scenario.vector_time)
    assert int(compiled_difference(draw, state[:: count // 40]).max()) <= 1
