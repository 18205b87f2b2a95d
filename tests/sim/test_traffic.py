"""Random encounters: the bounds of what is drawn, its classes, and what is refused."""

from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Generator, Tensor
from torchrl.envs.utils import check_env_specs

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import EncounterClass, World
from ship_trl.sim.encounter import Encounter, classify, relative_motion
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.starts import make_starts
from ship_trl.sim.state import (
    SHIP_BEHAVIOUR,
    SHIP_COUNT,
    SHIP_SPEED,
    goal_distance,
    is_present,
    target_ships,
)
from ship_trl.sim.suites import load_suite
from ship_trl.sim.traffic import TrafficStarts

COUNT = 2000
# Count of ships, then x, y, heading, speed and behaviour of each place, in the scene of seed 5.
PINNED = [3.0, 180.4, -132.8, 1.9, 18.7, 0.0, -11.9, -110.5, 1.5, 19.2, 0.0, -42.5, 115.0, 1.5, 11.1, 0.0]


def scenes(world: World, seed: int = 0, count: int = COUNT, **changes: Any) -> Tensor:
    traffic = load_suite("traffic", world).traffic
    assert traffic is not None
    return TrafficStarts(replace(traffic, **changes), world).sample(count, Generator().manual_seed(seed))


def classes(states: Tensor) -> Tensor:
    motion = relative_motion(states)
    return classify(motion.bearing, motion.aspect)


def test_ships_would_pass_within_the_offset_if_all_kept_course(world: World) -> None:
    states = scenes(world)
    motion, present = relative_motion(states), is_present(states)
    assert float(motion.dcpa[present].max()) <= 45.01
    # At the meeting point, a share of 0.3 to 0.9 of the 40 s to the goal.
    assert 11.9 < float(motion.tcpa[present].min()) < float(motion.tcpa[present].max()) < 36.1
    assert 54.0 <= float(motion.distance[present].min()) < float(motion.distance[present].max()) <= 640.1
    assert bool((goal_distance(states) == 600.0).all())
    # Empty places hold zeros.
    assert not bool(target_ships(states)[~present].any())


def test_the_shares_of_ships_and_classes_are_those_of_the_suite(world: World) -> None:
    states = scenes(world)
    shares = torch.bincount(states[:, SHIP_COUNT].long(), minlength=4) / COUNT
    assert shares.tolist() == pytest.approx([0.1, 0.3, 0.3, 0.3], abs=0.04)
    found = torch.bincount(classes(states)[is_present(states)], minlength=len(Encounter))
    # A class whose candidates fail more often is rarer, but none is lost.
    assert int(found[Encounter.NONE]) == 0
    assert float(found[1:].min()) > 0.1 * float(found.sum())


@pytest.mark.parametrize("name", [one.name for one in EncounterClass])
def test_a_class_alone_is_drawn_alone(name: str, world: World) -> None:
    states = scenes(world, count=200, classes=[EncounterClass[name]], ships=[0.0, 1.0])
    assert set(classes(states).flatten().tolist()) == {Encounter[name.upper()]}
    speeds = target_ships(states)[..., SHIP_SPEED]
    least, most = {"overtaking": (7.5, 12.0), "overtaken": (18.0, 22.5)}.get(name, (7.5, 15.0))
    assert least <= float(speeds.min()) < float(speeds.max()) <= most


def test_a_seed_is_a_scene_for_good(world: World) -> None:
    assert torch.equal(scenes(world, seed=3, count=50), scenes(world, seed=3, count=50))
    assert not torch.equal(scenes(world, seed=3, count=50), scenes(world, seed=4, count=50))
    # These must never change: results name a scene by its seed.
    states = scenes(world, seed=5, count=1)
    assert [round(one, 1) for one in states[0, SHIP_COUNT:].tolist()] == PINNED


def test_the_share_of_reacting_ships_is_that_of_the_suite(world: World) -> None:
    states = scenes(world, reacting=0.5)
    behaviour = target_ships(states)[is_present(states)][:, SHIP_BEHAVIOUR]
    assert set(behaviour.tolist()) == {0.0, 1.0}
    assert float(behaviour.mean()) == pytest.approx(0.5, abs=0.05)


def test_the_environment_fits_torchrl_and_begins_each_episode_with_its_own_scene(world: World) -> None:
    suite = load_suite("traffic", world)
    env = ShipEnv(suite, world, 16, generator=Generator().manual_seed(0))
    check_env_specs(env)
    first, second = env.reset()["state"].clone(), env.reset()["state"]
    assert len(torch.cat((first, second)).unique(dim=0)) > 25
    again = ShipEnv(suite, world, 16, generator=Generator().manual_seed(1))
    drawn = make_starts(suite, world).sample(16, Generator().manual_seed(1))
    assert torch.equal(again.reset()["state"], drawn)


def test_bounds_that_no_ship_keeps_are_refused(world: World) -> None:
    with pytest.raises(ConfigError, match="traffic: nearly no ship keeps these bounds"):
        scenes(world, count=1, distance=[0.0, 1.0], ships=[0.0, 1.0])


def test_a_suite_without_cases_says_so(world: World) -> None:
    with pytest.raises(ConfigError, match="suite traffic: has no cases; allowed here: one case"):
        _ = load_suite("traffic", world).case
