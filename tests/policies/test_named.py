"""A policy acts on the scenes of the environment in which it acts, whatever it was made for."""

import pickle
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torch import Generator

import ship_trl
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.types import World
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import make_network
from ship_trl.learn.rollout import rollout
from ship_trl.policies.named import load_policy, rollout_entry
from ship_trl.policies.reference import best_known
from ship_trl.policies.registry import Entry
from ship_trl.sim.cases import load_case, load_suite, suite_of
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.starts import Starts
from ship_trl.transfer.weights import save_weights


@pytest.mark.parametrize("colour", [False, True])
def test_a_network_sees_its_own_pictures_in_any_environment(
    colour: bool, world: World, tmp_path: Path
) -> None:
    seeing = replace(load_network(), vector_time=8.0)
    made = make_network(seeing, len(world.actions), Generator().manual_seed(0), colour=colour)
    save_weights(path := tmp_path / "seeing.safetensors", made, {})
    case = load_case("6", world)
    make_env = partial(ShipEnv, case, world, from_pixels=True)
    env = make_env(colour=colour, vector_time=8.0)
    wanted = made(env.reset()["pixels"])
    assert not torch.equal(wanted, made(make_env(colour=colour).reset()["pixels"]))
    for acts in (env, make_env(), make_env(colour=True)):
        assert torch.equal(load_policy(str(path), acts)(acts.reset())["action_value"], wanted)
    used, _, (episode,) = rollout_entry(Entry(str(path), "seeing", suite_of(case), world, colour=False))
    assert (used.rasteriser.vector_time, used.rasteriser.channels) == (8.0, 3 if colour else 1)
    assert episode.q_values is not None
    assert torch.equal(episode.q_values[0], wanted[0])


def test_best_known_follows_the_plan_of_each_case(world: World) -> None:
    suite = load_suite("paper", world)
    starts = Starts(suite, world).states
    env = make_env(suite, world, starts=starts)
    episodes = rollout(env, load_policy("best_known", env))
    for episode, case in zip(episodes, suite.cases, strict=True):
        assert episode.episode_return == pytest.approx(best_known(case, world).episode_return, abs=1e-2)


def test_a_plan_is_followed_in_a_batch_of_another_size(world: World) -> None:
    policy, env = ship_trl.load_policy("best_known", case="4"), make_env(load_case("4", world), world, 3)
    assert len({episode.episode_return for episode in rollout(env, policy)}) == 1


@pytest.mark.parametrize("name", ["pretrained:4", "vo"])
@pytest.mark.parametrize(
    ("given", "got"),
    [
        (torch.zeros(84, 84), "float32 [84, 84]"),
        (np.zeros((1, 84, 84), np.uint8), "uint8 [1, 84, 84]"),
        (None, "None"),
        (TensorDict(pixels=torch.zeros(1), batch_size=[1]), "a tensordict with pixels"),
        (TensorDict(state=torch.zeros(1, 84, 7)), "float32 [1, 84, 7]"),
        (TensorDict(state=torch.zeros(2, 14).int()), "int32 [2, 14]"),
    ],
)
def test_a_policy_refuses_what_has_no_states(name: str, given: Any, got: str, world: World) -> None:
    policy = load_policy(name, make_env(load_case("4", world), world))
    with pytest.raises(ConfigError) as refused:
        policy(given)
    assert f"policy: {name} is called with {got}; allowed: a tensordict with `state`" in str(refused.value)


@pytest.mark.parametrize("name", ["pretrained:4", "vo", "random"])
def test_torchrls_rollout_takes_every_policy(name: str, world: World) -> None:
    env = make_env(load_case("4", world), world, 2)
    (one, _), steps = rollout(env, load_policy(name, env)), env.rollout(20, load_policy(name, env))
    assert torch.equal(steps["action"][0], one.actions[:20])
    assert pickle.loads(pickle.dumps(load_policy("pretrained:4", env)))(env.reset())["action"].shape == (2,)
