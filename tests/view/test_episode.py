"""Numbers of an episode, whole or so far, and the pixels on which Q depends."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Generator

from ship_trl.config.types import World
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.sim.cases import Case, load_case, load_world
from ship_trl.view.episode import Telemetry, measure_episode, saliency
from tests.view.episodes import run_actions

PLANS = st.lists(st.integers(0, 6), min_size=1, max_size=12)
NAMES = st.sampled_from(["1", "2", "4", "6"])


def episode_of(name: str, plan: list[int]) -> tuple[World, Episode]:
    world = load_world()
    return world, run_actions(load_case(name, world), world, plan)


@settings(max_examples=12)
@given(NAMES, PLANS)
def test_the_terms_sum_up_and_the_end_is_the_environments(name: str, plan: list[int]) -> None:
    world, episode = episode_of(name, plan)
    numbers = measure_episode(world, episode)
    assert numbers.total[-1] == pytest.approx(episode.episode_return, abs=1e-3)
    assert np.diff(numbers.total) == pytest.approx(episode.rewards.numpy(), abs=1e-4)
    assert sum(numbers.terms.values()) == pytest.approx(numbers.total, abs=1e-3)
    assert set(numbers.terms) == {"goal", "collision", "distance", "deviation"}
    assert (numbers.terms["goal"][-1] > 0) == episode.goal
    assert (numbers.terms["collision"][-1] < 0) == episode.collision
    assert numbers.outcome == episode.outcome and numbers.steps == episode.length
    if numbers.ships.size:
        assert numbers.closest[-1].min() == pytest.approx(episode.dcpa, abs=1e-3)
        assert (numbers.closest <= numbers.apart + 1e-6).all()


@settings(max_examples=8)
@given(PLANS, st.integers(0, 60))
def test_an_episode_so_far_has_the_numbers_of_the_whole_one(plan: list[int], steps: int) -> None:
    world, episode = episode_of("4", plan)
    steps = min(steps, episode.length - 1)
    whole = measure_episode(world, episode)
    so_far = Telemetry(world, episode.states[: steps + 1], episode.actions[:steps])
    assert so_far.outcome is None and so_far.action(steps) is None and so_far.q(0) is None
    assert so_far.total == pytest.approx(whole.total[: steps + 1])
    # Of the start the first action is not known yet.
    known = slice(1 if steps == 0 else 0, steps + 1)
    assert so_far.dcpa[known] == pytest.approx(whole.dcpa[known])
    assert so_far.tcpa[known] == pytest.approx(whole.tcpa[known])


def test_dcpa_comes_true_where_all_keep_course() -> None:
    world, episode = episode_of("2", [3])
    numbers = measure_episode(world, episode)
    predicted = numbers.dcpa[0, 0]
    when = numbers.tcpa[0, 0]
    assert 0 < when < episode.length * world.dt
    assert numbers.dcpa[:, 0] == pytest.approx(predicted, abs=0.05)
    assert numbers.closest[-1, 0] == pytest.approx(predicted, abs=0.05)
    assert numbers.tcpa[:, 0] == pytest.approx(when - np.arange(episode.length + 1) * world.dt, abs=0.05)


def test_a_ship_heading_for_the_safe_circle_is_a_danger(make_case: Callable[..., Case], world: World) -> None:
    # Head on; far abeam on the same course; astern and slower.
    case = make_case((0.0, 900.0, 270.0, 5.0), (400.0, 0.0, 90.0, 15.0), (0.0, -100.0, 90.0, 1.0))
    numbers = measure_episode(world, run_actions(case, world, [3]))
    assert [numbers.is_danger(1, k) for k in range(3)] == [True, False, False]


def test_positions_between_steps_are_interpolated() -> None:
    world, episode = episode_of("4", [0, 3, 6])
    numbers = measure_episode(world, episode)
    for step in (0, 3, numbers.steps):
        own, ships = numbers.at(step)
        assert own == pytest.approx(numbers.states[step, :3]) and ships == pytest.approx(numbers.ships[step])
    own, ships = numbers.at(2.25)
    assert own == pytest.approx(0.75 * numbers.states[2, :3] + 0.25 * numbers.states[3, :3])
    assert ships == pytest.approx(0.75 * numbers.ships[2] + 0.25 * numbers.ships[3])
    for outside, end in ((-1.0, 0), (1e9, numbers.steps)):
        assert numbers.at(outside)[0] == pytest.approx(numbers.states[end, :3])


def test_the_closest_approach_is_within_steps_too(make_case: Callable[..., Case], world: World) -> None:
    """At 215 m/s a ship is 104 m away before and after the second step, and 60 m abeam in between."""
    case = make_case((60.0, 300.0, 270.0, 200.0))
    numbers = measure_episode(world, run_actions(case, world, [3]))
    assert numbers.closest[1:4, 0] == pytest.approx([104.04, 60.0, 60.0], abs=0.01)
    found = numbers.closest_places()
    assert found is not None and np.linalg.norm(found[0] - found[1]) == pytest.approx(60.0, abs=1.0)
    alone = measure_episode(world, run_actions(make_case(), world, [3]))
    assert alone.closest_places() is None


def test_saliency_marks_pixels_that_change_q() -> None:
    made = DuelingNetwork(1, 7, Generator().manual_seed(1))
    pixels = torch.randint(0, 256, (1, 84, 84), generator=Generator().manual_seed(2), dtype=torch.uint8)
    heat = torch.from_numpy(saliency(made, pixels))
    assert heat.shape == (84, 84) and float(heat.max()) == 1.0 and float(heat.min()) >= 0
    # Single pixels cancel; a bright one has more effect than a dark one in the mean.
    order = heat.flatten().argsort()
    moved = pixels.float().flatten().repeat(100, 1)
    moved[torch.arange(100), torch.cat((order[:400:8], order[-400::8]))] += 1.0
    with torch.no_grad():
        before = made(pixels[None])[0]
        after = made.dueling(made.encode(moved.view(100, 1, 84, 84)))[:, before.argmax()]
    dark, bright = (after - before.max()).abs().view(2, 50).mean(1)
    assert bright > 2 * dark
