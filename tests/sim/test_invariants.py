"""Invariants in any world: frames of reference, mirroring, rotation and translation, batching."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from torch import Tensor

from ship_trl.sim.env import ShipEnv
from ship_trl.sim.fast.compiled import CompiledStep
from ship_trl.sim.reward import POSITION_TOLERANCE
from ship_trl.sim.transition import Transition
from tests.sim.anywhere import Voyage, mirrored, voyages
from tests.sim.moving import moved_case

Places = NDArray[np.float64]
# Metres: error of 40 steps in float32, some hundred metres from the origin, against float64.
MAX_POSITION_ERROR = 0.02
# Maximum difference of pixel values, of 256, that rounding of positions may cause.
MAX_PIXEL_ERROR = 2


@dataclass
class Moment:
    """Result of one step."""

    state: Tensor
    reward: float
    dcpa: float
    outcome: str
    pixels: Tensor


def rollout(voyage: Voyage) -> list[Moment]:
    """Roll out the actions in the environment until the episode ends."""
    env, found = ShipEnv(voyage.case, voyage.world, from_pixels=True), []
    step = env.reset()
    for action in voyage.actions:
        step = env.step(step.set("action", torch.tensor([action])))["next"]
        flags = {name: bool(step[name]) for name in ("collision", "goal", "truncated")}
        outcome = next((name for name, happened in flags.items() if happened), "")
        assert bool(step["done"]) == bool(outcome) and sum(flags.values()) <= 1
        found.append(
            Moment(step["state"][0], float(step["reward"]), float(step["dcpa"]), outcome, step["pixels"][0])
        )
        if outcome:
            break
    return found


@dataclass
class Distances:
    """Distances after a step in metres, and the goal's angle off the bow in radians."""

    place: Places
    to_goal: float
    off_bow: float
    apart: float


def least(before: Places, after: Places) -> float:
    """Return the least distance from the origin to points moving straight, [K, 2]; infinite if K is 0."""
    way = after - before
    square = (way * way).sum(-1)
    share = np.clip(-(before * way).sum(-1) / np.where(square > 0, square, 1), 0, 1)
    return float(np.hypot(*(before + share[:, None] * way).T).min(initial=math.inf))


def simulate_absolute(voyage: Voyage) -> list[Distances]:
    """Simulate in float64 in fixed coordinates: own ship and target ships move."""
    case, world = voyage.case, voyage.world
    place, heading = np.array(case.start), math.radians(case.heading)
    ships = np.array([[s.x, s.y] for s in case.target_ships]).reshape(-1, 2)
    angles = [math.radians(s.heading) for s in case.target_ships]
    pairs = zip(case.target_ships, angles, strict=True)
    velocity = np.array([[s.speed * math.cos(a), s.speed * math.sin(a)] for s, a in pairs]).reshape(-1, 2)
    found = []
    for action in voyage.actions:
        speed, turn = world.actions[action]
        heading += turn * world.dt
        after = place + speed * world.dt * np.array([math.cos(heading), math.sin(heading)])
        later = ships + velocity * world.dt
        sight = np.array(case.goal) - after
        off = math.remainder(math.atan2(sight[1], sight[0]) - heading, 2 * math.pi)
        found.append(Distances(after, math.hypot(*sight), off, least(ships - place, later - after)))
        place, ships = after, later
    return found


def simulate_relative(voyage: Voyage) -> list[Distances]:
    """Simulate in float64 in own ship's coordinates: it stays at the origin, heading along x."""
    case, world = voyage.case, voyage.world

    def turned(points: Places, by: float) -> Places:
        cos, sin = math.cos(by), math.sin(by)
        return points @ np.array([[cos, sin], [-sin, cos]])

    heading = math.radians(case.heading)
    goal = turned(np.array([case.goal]) - case.start, -heading)
    ships = np.array([[s.x, s.y] for s in case.target_ships]).reshape(-1, 2) - case.start
    ships = turned(ships, -heading)
    courses = np.radians([s.heading for s in case.target_ships]) - heading
    speeds = np.array([s.speed for s in case.target_ships])
    found = []
    for action in voyage.actions:
        speed, turn = world.actions[action]
        goal, ships, courses = (
            turned(goal, -turn * world.dt),
            turned(ships, -turn * world.dt),
            courses - turn * world.dt,
        )
        own = np.array([speed * world.dt, 0.0])
        way = (speeds * world.dt)[:, None] * np.stack((np.cos(courses), np.sin(courses)), -1)
        goal, later = goal - own, ships + way - own
        off = math.atan2(goal[0, 1], goal[0, 0])
        found.append(Distances(np.empty(0), math.hypot(*goal[0]), off, least(ships, later)))
        ships = later
    return found


def outcome_of(voyage: Voyage, step: int, now: Distances) -> str | None:
    """Return how a step ends, or None if rounding decides."""
    world = voyage.world
    if abs(now.apart - world.safe_distance) < MAX_POSITION_ERROR:
        return None
    if now.apart < world.safe_distance:
        return "collision"
    if abs(now.to_goal - world.goal_distance - POSITION_TOLERANCE) < MAX_POSITION_ERROR:
        return None
    if now.to_goal < world.goal_distance:
        return "goal"
    return "truncated" if step + 1 >= world.max_steps else ""


@given(voyages())
def test_frames_agree_with_each_other_and_with_the_environment(voyage: Voyage) -> None:
    ended, nearest = rollout(voyage), math.inf
    for step, (moment, chart, board) in enumerate(
        zip(ended, simulate_absolute(voyage), simulate_relative(voyage), strict=False)
    ):
        assert (board.to_goal, board.apart) == pytest.approx((chart.to_goal, chart.apart), abs=1e-6)
        assert abs(math.remainder(board.off_bow - chart.off_bow, 2 * math.pi)) < 1e-6
        nearest = min(nearest, chart.apart)
        assert moment.state[:2].numpy() == pytest.approx(chart.place, abs=MAX_POSITION_ERROR)
        assert moment.dcpa == pytest.approx(nearest, abs=MAX_POSITION_ERROR)
        wanted = outcome_of(voyage, step, board)
        if wanted is None:
            return
        assert moment.outcome == wanted
        reward = voyage.world.reward
        paid = reward.w3 * reward.k1 * chart.to_goal + reward.w4 * reward.k2 * abs(
            math.degrees(board.off_bow)
        )
        paid += {"goal": reward.w1 * reward.goal, "collision": reward.w2 * reward.collision}.get(wanted, 0.0)
        # Near the goal, a centimetre turns the line of sight noticeably.
        turned = math.degrees(MAX_POSITION_ERROR / max(chart.to_goal, MAX_POSITION_ERROR))
        slack = 4 * (MAX_POSITION_ERROR + turned + 0.05)
        assert moment.reward == pytest.approx(paid, abs=slack, rel=1e-4)


@given(voyages())
def test_the_mirrored_world_is_bit_identical(voyage: Voyage) -> None:
    """Mirror about the x axis, where sines change sign exactly: only the angle is rounded."""
    here, there = rollout(voyage), rollout(mirrored(voyage))
    assert [moment.outcome for moment in here] == [moment.outcome for moment in there]
    sign = torch.tensor([1.0, -1.0, -1.0, 1.0])
    for one, other in zip(here, there, strict=True):
        assert torch.equal(one.state * sign, other.state) and one.dcpa == other.dcpa
        assert other.reward == pytest.approx(one.reward, abs=1e-2, rel=1e-5)
        # Port and starboard change sides; the picture is rotated by a quarter turn, which is rounded.
        assert int((one.pixels.flip(-1).int() - other.pixels.int()).abs().max()) <= MAX_PIXEL_ERROR


@given(voyages(), st.floats(-180, 180), st.tuples(st.floats(-300, 300), st.floats(-300, 300)))
def test_the_turned_and_shifted_world_looks_and_pays_the_same(
    voyage: Voyage, degrees: float, shift: tuple[float, float]
) -> None:
    there = replace(voyage, case=moved_case(voyage.case, degrees, shift))
    ways = rollout(voyage), rollout(there)
    for step, (one, other, chart) in enumerate(zip(*ways, simulate_absolute(voyage), strict=False)):
        if outcome_of(voyage, step, chart) is None:
            return
        assert one.outcome == other.outcome
        assert other.dcpa == pytest.approx(one.dcpa, abs=2 * MAX_POSITION_ERROR)
        turned = math.degrees(MAX_POSITION_ERROR / max(chart.to_goal, MAX_POSITION_ERROR))
        assert other.reward == pytest.approx(
            one.reward, abs=8 * (MAX_POSITION_ERROR + turned + 0.05), rel=1e-4
        )
        assert int((one.pixels.int() - other.pixels.int()).abs().max()) <= MAX_PIXEL_ERROR


@given(voyages(), st.integers(2, 9))
def test_a_batch_is_bit_identical_to_its_ships_one_by_one(voyage: Voyage, count: int) -> None:
    env = ShipEnv(voyage.case, voyage.world, count, from_pixels=True, colour=True)
    single = ShipEnv(voyage.case, voyage.world, 1, from_pixels=True, colour=True)
    together, singles = env.reset(), [single.reset() for _ in range(count)]
    for first, other in list(zip(voyage.actions, voyage.also, strict=True))[:12]:
        actions = torch.tensor(
            [first if n % 2 else (other + n) % len(voyage.world.actions) for n in range(count)]
        )
        stepped, together = env.step_and_maybe_reset(together.set("action", actions))
        for n in range(count):
            alone, singles[n] = single.step_and_maybe_reset(singles[n].set("action", actions[n : n + 1]))
            for key in ("state", "reward", "dcpa", "goal", "collision", "truncated", "done", "pixels"):
                assert torch.equal(stepped["next", key][n], alone["next", key][0]), key
            for key in ("state", "dcpa", "pixels"):
                assert torch.equal(together[key][n], singles[n][key][0]), key


@given(voyages(), st.integers(0, 2**31))
@settings(max_examples=40)
def test_the_compiled_loops_are_the_reference_in_any_world(voyage: Voyage, seed: int) -> None:
    generator, count = torch.Generator().manual_seed(seed), 400
    reference = Transition(voyage.case, voyage.world, torch.device("cpu"))
    state = torch.rand(count, 4, generator=generator) * torch.tensor([1600.0, 1600.0, 6 * math.pi, 0.0])
    state[:, :2] += reference.start[:2] - 800.0
    state[:, 3] = torch.randint(voyage.world.max_steps, (count,), generator=generator)
    # A quarter each about the goal and a ship, where the outcome turns.
    spread = torch.randn(count, 2, generator=generator) * 40
    state[: count // 4, :2] = reference.goal + spread[: count // 4]
    if voyage.case.target_ships:
        half = slice(count // 4, count // 2)
        state[half, :2] += reference.relative_positions(state)[half, 0] + spread[half]
    action = torch.randint(len(voyage.world.actions), (count,), generator=generator)
    wanted, got = reference(state, action), CompiledStep(reference)(state, action)
    torch.testing.assert_close(got.state, wanted.state, rtol=1e-6, atol=3e-4)
    torch.testing.assert_close(got.min_distance, wanted.min_distance, rtol=1e-5, atol=2e-3)
    on_edge = (wanted.min_distance - voyage.world.safe_distance).abs() < MAX_POSITION_ERROR
    on_edge |= (
        reference.goal_distance(wanted.state) - voyage.world.goal_distance - POSITION_TOLERANCE
    ).abs() < MAX_POSITION_ERROR
    for flag in ("goal", "collision", "truncated"):
        assert torch.equal(getattr(got, flag)[~on_edge], getattr(wanted, flag)[~on_edge]), flag
    torch.testing.assert_close(got.reward[~on_edge], wanted.reward[~on_edge], rtol=1e-4, atol=5e-2)
    draw = ShipEnv(voyage.case, voyage.world).rasteriser
    some = state[:: count // 40]
    pictures = draw(some).int() - draw.reference(some).int().view(len(some), -1, 84, 84)
    assert int(pictures.abs().max()) <= 1
