"""Random encounters: the bounds of what is drawn, its classes, and what is refused."""

from dataclasses import replace
from itertools import product
from typing import Any

import pytest
import torch
from torch import Generator, Tensor
from torchrl.envs.utils import check_env_specs

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env, make_starts
from ship_trl.sim.cases import load_suite, load_world
from ship_trl.sim.encounter import Encounter, Tracker, classify, relative_motion
from ship_trl.sim.starts import TrafficStarts
from ship_trl.sim.state import (
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    goal_distance,
    goal_off_bow,
    is_present,
    target_ships,
)
from ship_trl.sim.transition import Transition

COUNT = 2000
# Count of ships, then x, y, heading, speed and behaviour of each place, in the scene of seed 8.
PINNED = [3.0, -68.9, -66.4, 1.4, 20.6, 0.0, 289.6, 222.6, 2.4, 11.5, 0.0, 32.9, 417.2, 4.7, 8.4, 0.0]


def scenes(world: World, seed: int = 0, count: int = COUNT, **changes: Any) -> Tensor:
    traffic = load_suite("traffic_near", world).traffic
    assert traffic is not None
    return TrafficStarts(replace(traffic, **changes), world).sample(count, Generator().manual_seed(seed))


@pytest.fixture(scope="module")
def many() -> Tensor:
    return scenes(load_world())


def classes(states: Tensor) -> Tensor:
    motion = relative_motion(states)
    return classify(motion.bearing, motion.aspect)


def test_ships_would_pass_within_the_offset_if_all_kept_course(many: Tensor) -> None:
    states = many
    motion, present = relative_motion(states), is_present(states)
    assert float(motion.dcpa[present].max()) <= 45.01
    # At the meeting point, a share of 0.3 to 0.9 of the 40 s to the goal.
    assert 11.9 < float(motion.tcpa[present].min()) < float(motion.tcpa[present].max()) < 36.1
    assert 54.0 <= float(motion.distance[present].min()) < float(motion.distance[present].max()) <= 640.1
    assert bool((goal_distance(states) == 600.0).all())
    # Empty places hold zeros.
    assert not bool(target_ships(states)[~present].any())


def test_the_shares_of_ships_and_classes_are_those_of_the_suite(many: Tensor) -> None:
    states = many
    shares = torch.bincount(states[:, SHIP_COUNT].long(), minlength=4) / COUNT
    assert shares.tolist() == pytest.approx([0.1, 0.3, 0.3, 0.3], abs=0.04)
    found = classes(states)[is_present(states)]
    assert (torch.bincount(found, minlength=len(Encounter)) / len(found)).tolist() == pytest.approx(
        [0.0] + [0.2] * 5, abs=0.02
    )


def test_a_seed_is_a_scene_for_good(world: World) -> None:
    assert torch.equal(scenes(world, seed=3, count=50), scenes(world, seed=3, count=50))
    assert not torch.equal(scenes(world, seed=3, count=50), scenes(world, seed=4, count=50))
    # These must never change: results name a scene by its seed.
    states = scenes(world, seed=8, count=1)
    ships = target_ships(states)[0, :, : SHIP_BEHAVIOUR + 1].flatten()
    assert [round(float(one), 1) for one in (states[0, SHIP_COUNT], *ships)] == PINNED


def test_a_scene_depends_on_its_own_seed_alone(world: World) -> None:
    starts, generator = make_starts(load_suite("traffic_near", world), world), Generator().manual_seed(7)
    together = starts.sample(20, Generator().manual_seed(7))
    assert all((starts.sample(1, generator)[0] == row).all() for row in together)


def test_in_every_scene_a_simple_manoeuvre_reaches_the_goal(world: World) -> None:
    states, transition = scenes(world, count=60), Transition(world)
    # Hold an action, sail straight on, then steer for the goal.
    plans = torch.tensor(list(product((2, 4, 7, 11, 16), (0, 4, 9, 15), (0, 1, 2, 4, 5, 6))))
    hold, straight, action = (column.repeat(len(states)) for column in plans.unbind(1))
    state = states.repeat_interleave(len(plans), 0)
    is_over, arrived = torch.zeros(2, len(state), dtype=torch.bool)
    for step in range(world.max_steps):
        steering = (goal_off_bow(state)[:, None] - transition.actions[:, 1]).abs().argmin(-1)
        chosen = torch.where(step < hold, action, 3)
        outcome = transition(state, torch.where(step < hold + straight, chosen, steering))
        arrived |= outcome.goal & ~is_over
        is_over |= outcome.goal | outcome.collision
        state = outcome.state
    assert bool(arrived.view(len(states), -1).any(-1).all())


def test_the_environment_fits_torchrl_and_begins_each_episode_with_its_own_scene(world: World) -> None:
    suite = load_suite("traffic", world)
    env = make_env(suite, world, 16, generator=Generator().manual_seed(0))
    check_env_specs(env)
    first, second = env.reset()["state"].clone(), env.reset()["state"]
    assert len(torch.cat((first, second)).unique(dim=0)) > 25
    again = make_env(suite, world, 16, generator=Generator().manual_seed(1))
    drawn = make_starts(suite, world).sample(16, Generator().manual_seed(1))
    assert torch.equal(again.reset()["state"], Tracker(world)(drawn, drawn))


def test_bounds_that_no_ship_keeps_are_refused(world: World) -> None:
    with pytest.raises(ConfigError, match="traffic: nearly no ship keeps these bounds"):
        scenes(world, count=1, distance=[600.0, 600.1], ships=[0.0, 1.0])
