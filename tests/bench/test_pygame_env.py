"""The pygame environment is the same world: same outcomes and rewards, and the same picture in the large."""

import warnings

import gymnasium
import numpy as np
import pytest
import torch
import torch.nn.functional as F
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from ship_trl.bench.pygame_env import PygameShipEnv, TunedPygameShipEnv, still_picture
from ship_trl.bench.simulator import batched, faster_env, fleet, one_by_one, vector
from ship_trl.config.types import World
from ship_trl.sim.cases import case_names, check_case, load_case, load_world
from ship_trl.sim.env import ShipEnv

KINDS = (PygameShipEnv, TunedPygameShipEnv)


@pytest.mark.parametrize("kind", KINDS)
def test_gymnasium_accepts_it(kind: type[PygameShipEnv], world: World) -> None:
    env = kind(load_case("4", world), world)
    assert isinstance(env, gymnasium.Env)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*render.*|.*spec is None.*")
        check_env(env, skip_render_check=True)


def apart(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> float:
    """Mean absolute difference of two pictures, seen from afar: pygame's edges are hard, ours soft."""
    small = [F.avg_pool2d(torch.tensor(picture.astype(np.float32))[None], 4) for picture in (left, right)]
    return float((small[0] - small[1]).abs().mean())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", case_names())
def test_it_is_the_same_world(name: str, kind: type[PygameShipEnv], world: World) -> None:
    case, random = load_case(name, world), np.random.default_rng(7)
    theirs, ours = kind(case, world), ShipEnv(case, world, 1, from_pixels=True)
    right, mirrored, empty = [], [], []
    for _ in range(2):
        picture, _ = theirs.reset()
        still = still_picture(world)
        step, over = ours.reset(), False
        while not over:
            mine = step["pixels"][0, 0].numpy()
            right.append(apart(picture[0], mine))
            mirrored.append(apart(picture[0, :, ::-1], mine))
            empty.append(apart(still, mine))
            action = random.integers(7)
            picture, reward, terminated, truncated, info = theirs.step(action)
            step = ours.step(step.set("action", torch.tensor([action])))["next"]
            assert reward == pytest.approx(float(step["reward"]), abs=2e-3)
            assert (terminated, truncated) == (bool(step["terminated"]), bool(step["truncated"]))
            assert (info["goal"], info["collision"]) == (bool(step["goal"]), bool(step["collision"]))
            assert info["dcpa"] == pytest.approx(float(step["dcpa"]), abs=1e-2)
            over = terminated or truncated
    # Grey levels, of 256. The one draws even the circles with hard edges, the other copies soft ones.
    assert max(right) < (0.9 if kind is TunedPygameShipEnv else 2.5)
    assert np.mean(mirrored) > np.mean(right) + 0.4
    assert kind is PygameShipEnv or np.mean(empty) > np.mean(right) + 0.4


@pytest.mark.parametrize("kind", KINDS)
def test_each_picture_is_its_own(kind: type[PygameShipEnv], world: World) -> None:
    env = kind(load_case("4", world), world)
    first, _ = env.reset()
    kept = first.copy()
    env.step(np.int64(0))
    assert np.array_equal(first, kept)


def test_reward_scale(world: World) -> None:
    case = load_case("4", world)
    plain, scaled = PygameShipEnv(case, world), PygameShipEnv(case, world, 0.01)
    assert scaled.step(np.int64(0))[1] == pytest.approx(plain.step(np.int64(0))[1] * 0.01)


def test_probes_step(world: World) -> None:
    case = load_case("1", world)
    assert one_by_one(PygameShipEnv(case, world))() == 64
    assert batched(case, world, 16)() == 64 and batched(case, world, 128)() == 128
    assert vector("1", 16)() == 64 and vector("1", 128)() == 128
    make_env, said = faster_env("1", 0.01, seconds=0.01)
    assert "steps/s" in said and isinstance(make_env(), gymnasium.Env)


@pytest.mark.parametrize("ships", [0, 3, 8])
def test_fleets_can_be_sailed(ships: int) -> None:
    world = load_world()
    case = fleet(load_case("1", world), ships)
    assert len(case.target_ships) == ships
    check_case(case, world, "fleet")
