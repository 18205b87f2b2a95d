"""The pygame environment is the same world: the same outcomes and rewards, and nearly the same picture."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from numpy.typing import NDArray

from benchmarks.pygame_env import PygameShipEnv, TunedPygameShipEnv
from benchmarks.simulator import draw_cases
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.sim.cases import load_case
from ship_trl.sim.env import ShipEnv

KINDS = (PygameShipEnv, TunedPygameShipEnv)
# The last two: own ship starts elsewhere, and there are three ships.
CASES = ("2", "4", "6", "ship", "imazu16")


def difference(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> float:
    """Mean absolute difference of two blurred pictures: pygame's edges are hard, ours soft."""
    small = [F.avg_pool2d(torch.tensor(picture.astype(np.float32))[None], 4) for picture in (left, right)]
    return float((small[0] - small[1]).abs().mean())


def compare_episode(theirs: PygameShipEnv, ours: ShipEnv, random: np.random.Generator) -> list[list[float]]:
    """Compare an episode of random actions; return the differences of the pictures, and of mirrored ones."""
    right, mirrored = [], []
    pixels, _ = theirs.reset()
    step, over = ours.reset(), False
    while not over:
        mine = step["pixels"][0, 0].numpy()
        right.append(difference(pixels[0], mine))
        mirrored.append(difference(pixels[0, :, ::-1], mine))
        action = random.integers(7)
        pixels, reward, terminated, truncated, info = theirs.step(action)
        step = ours.step(step.set("action", torch.tensor([action])))["next"]
        assert reward == pytest.approx(float(step["reward"]), abs=2e-3)
        assert (terminated, truncated) == (bool(step["terminated"]), bool(step["truncated"]))
        assert (info["goal"], info["collision"]) == (bool(step["goal"]), bool(step["collision"]))
        assert info["least_distance"] == pytest.approx(float(step["dcpa"]), abs=1e-2)
        over = terminated or truncated
    # Grey levels of 256. The one draws even the circles with hard edges, the other copies soft ones.
    assert max(right) < (0.9 if isinstance(theirs, TunedPygameShipEnv) else 2.5)
    return [right, mirrored]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CASES)
def test_it_is_the_same_world(name: str, kind: type[PygameShipEnv], world: World) -> None:
    case, random = load_case(name, world), np.random.default_rng(7)
    theirs, ours = kind([case], world), make_env(case, world, 1, from_pixels=True)
    right, mirrored = np.hstack([compare_episode(theirs, ours, random) for _ in range(2)])
    assert np.mean(mirrored) > np.mean(right) + 0.4


@pytest.mark.parametrize("kind", KINDS)
def test_of_random_encounters_each_episode_is_the_next_scene(kind: type[PygameShipEnv], world: World) -> None:
    cases, random = draw_cases(6), np.random.default_rng(7)
    assert len({case.fingerprint for case in cases}) >= 5  # those without ships are alike
    theirs = kind(cases, world)
    for case in [*cases, cases[0]]:
        compare_episode(theirs, make_env(case, world, 1, from_pixels=True), random)
