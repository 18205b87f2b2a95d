"""Gymnasium's and Stable-Baselines3's own checks, and a training of each."""

import time
import warnings
from typing import Any

import gymnasium
import numpy as np
import pygame
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import DQN
from stable_baselines3.common.env_checker import check_env as check_sb3

from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.gym.env import ENV_ID, ShipCollisionEnv
from ship_trl.sim.cases import load_world
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.state import STEP
from ship_trl.sim.vector import VectorObservation


@pytest.mark.parametrize("colour", [False, True])
def test_gymnasium_accepts_it(colour: bool) -> None:
    env = ShipCollisionEnv(case="4", colour=colour, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*render modes.*|.*spec is None.*")
        check_env(env, skip_render_check=False)
    assert env.observation_space.shape == (84, 84, 3 if colour else 1)


def test_it_is_made_by_name() -> None:
    env = gymnasium.make(f"ship_trl.gym.env:{ENV_ID}", case="3", reward_scale=0.01)
    observation, info = env.reset(seed=1)
    assert observation.shape == (84, 84, 1) and info["least_distance"] == float("inf")
    total, steps, terminated, truncated = 0.0, 0, False, False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = env.step(np.int64(3))
        total, steps = total + float(reward), steps + 1
    assert (steps, terminated, truncated, info["collision"]) == (19, True, False, True)
    assert total == pytest.approx(-2.855, abs=1e-3)


@pytest.mark.parametrize(
    ("action", "got"),
    [
        (-1, "-1"),
        (7, "7"),
        (2.0, "float64 ()"),
        (np.array([3]), "int64 (1,)"),
        (True, "bool ()"),
        (None, "object ()"),
    ],
)
@pytest.mark.parametrize("fast", [True, False])
def test_what_is_no_action_is_refused(action: Any, got: str, fast: bool) -> None:
    env = ShipCollisionEnv(case="4", fast=fast)
    state = env.reset()[1]["state"]
    with pytest.raises(ValueError, match="actions: must be whole numbers from 0 to 6") as refused:
        env.step(action)
    assert str(refused.value).endswith(f"got {got}")
    straight: Any = np.array(3)
    assert env.step(straight)[4]["state"][STEP] == state[STEP] + 1


def test_all_checks_of_gymnasium_pass_in_every_render_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make(f"ship_trl.gym:{ENV_ID}", case="traffic")
    assert env.spec is not None and env.spec.max_episode_steps == load_world().max_steps
    check_env(env.unwrapped)


def test_a_window_shows_each_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env, drawn = (ShipCollisionEnv(case="4", render_mode=mode) for mode in ("human", "rgb_array"))
    begin, straight = time.monotonic(), np.int64(3)
    for step in range(4):
        shown, wanted = ((one.step(straight) if step else one.reset())[0] for one in (env, drawn))
        assert np.array_equal(shown, wanted)
        window, picture = pygame.display.get_surface(), drawn.render()
        assert window is not None and picture is not None and env.render() is None
        assert np.array_equal(pygame.surfarray.array3d(window).swapaxes(0, 1), picture)
    assert time.monotonic() - begin > 3 / env.metadata["render_fps"]
    env.close()
    env.close()
    assert not pygame.display.get_init()
    # Another window may close ours.
    env.reset()
    pygame.quit()
    env.reset()
    assert pygame.display.get_surface() is not None
    env.close()


def test_without_a_screen_a_window_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "nothing")
    with pytest.raises(ConfigError, match=r"no screen .*allowed without a screen: render_mode=rgb_array"):
        ShipCollisionEnv(render_mode="human").reset()


def test_it_renders_a_large_picture() -> None:
    env = ShipCollisionEnv(case="4", render_mode="rgb_array")
    env.reset()
    picture = env.render()
    assert picture is not None and picture.shape == (600, 600, 3) and picture.std() > 5


def test_of_a_suite_it_renders_the_ships_of_the_scene_alone() -> None:
    env = ShipCollisionEnv(case="paper", render_mode="rgb_array")
    pictures = {}
    for name in ("1", "2", "3", "4", "5", "6", "new"):
        single = ShipCollisionEnv(case=name, render_mode="rgb_array")
        single.reset()
        pictures[np.asarray(single.render()).tobytes()] = name
    seen = set()
    for seed in range(12):
        env.reset(seed=seed)
        seen.add(pictures[np.asarray(env.render()).tobytes()])
    assert len(seen) > 3 and "1" in seen


def test_stable_baselines3_trains_on_it_unchanged() -> None:
    env = gymnasium.make(ENV_ID, case="2")
    check_sb3(env.unwrapped, warn=True)
    model = DQN("CnnPolicy", env, buffer_size=300, learning_starts=40, train_freq=4, batch_size=8, seed=0)
    before = next(model.q_net.parameters()).clone()
    model.learn(120)
    assert not bool((before == next(model.q_net.parameters())).all())


def test_torch_alone_steps_and_draws_alike() -> None:
    compiled, plain = (ShipCollisionEnv(case="4", fast=fast) for fast in (True, False))
    assert np.abs(compiled.reset()[0].astype(int) - plain.reset()[0]).max() <= 1
    for action in np.array([3] * 10 + [0] * 5 + [6] * 3):
        (pixels, reward, *ends, info), (other, paid, *others, told) = (
            compiled.step(action),
            plain.step(action),
        )
        assert np.abs(pixels.astype(int) - other).max() <= 1 and ends[:2] == others[:2]
        assert abs(reward - paid) < 1e-3 and abs(info["least_distance"] - told["least_distance"]) < 1e-3


@pytest.mark.parametrize(("colour", "vector_time"), [(False, 0.0), (True, 0.0), (False, 8.0)])
def test_it_shows_what_the_network_sees_channels_last(colour: bool, vector_time: float) -> None:
    env, world = ShipCollisionEnv(case="4", colour=colour, vector_time=vector_time), load_world()
    env.reset()
    observation, _, _, _, info = env.step(np.int64(0))
    draw = Rasteriser(world, colour=colour, vector_time=vector_time)
    picture = draw(torch.from_numpy(info["state"]))
    assert np.array_equal(np.moveaxis(observation, -1, 0), picture.numpy())


def test_as_a_vector_it_gives_the_numbers_of_the_networks() -> None:
    env, observe = gymnasium.make(ENV_ID, case="traffic", observation="vector"), VectorObservation
    check_sb3(env.unwrapped, warn=True)
    wanted = observe(load_world(), load_network("vector").ships)
    for observation, info in (env.reset(seed=3), env.step(np.int64(0))[::4]):
        assert observation in env.observation_space and observation.dtype == np.float32
        assert np.array_equal(observation, wanted(torch.from_numpy(info["state"])[None])[0].numpy())
