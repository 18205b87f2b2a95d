"""A policy acts on what Gymnasium's environment gives, and refuses the rest in one line."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3.common.evaluation import evaluate_policy
from torch import Generator

import ship_trl
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.fast.worlds import make_env
from ship_trl.gym import ENV_ID
from ship_trl.learn.network import make_network
from ship_trl.learn.rollout import rollout
from ship_trl.sim.cases import load_case, load_world
from ship_trl.transfer.weights import save_weights


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("4", {"observation": "pixels", "colour": False, "vector_time": 0.0}),
        ("traffic_pixels", {"observation": "pixels", "colour": True, "vector_time": 8.0}),
        ("traffic", {"observation": "vector"}),
        ("apf", {}),
    ],
)
def test_it_acts_in_gymnasium_as_in_torchrl(name: str, options: dict[str, Any]) -> None:
    policy, world = ship_trl.load_policy(name), load_world()
    assert policy.env_options == options and policy.observation == options.get("observation", "state")
    (episode,) = rollout(make_env(load_case("4", world), world), policy)
    env = gymnasium.make(ENV_ID, case="4", **policy.env_options)
    seen, info = env.reset()
    for action in episode.actions.tolist():
        observation = seen if options else info["state"]
        chosen, hidden = policy.predict(observation)
        assert int(chosen) == action and hidden is None and chosen.shape == () and chosen.dtype == np.int64
        seen, _, terminated, truncated, info = env.step(chosen)
    assert terminated or truncated
    batch = np.stack([observation, observation])
    assert policy.predict(batch)[0].tolist() == [action, action]
    if policy.observation == "pixels":
        assert policy.predict(np.moveaxis(batch, -1, 1))[0].tolist() == [action, action]
    assert policy.predict(torch.from_numpy(batch))[0].tolist() == [action, action]


def test_stable_baselines3_evaluates_it() -> None:
    policy: Any = ship_trl.load_policy("traffic")
    env = gymnasium.make(ENV_ID, case="4", **policy.env_options)
    reached, _ = evaluate_policy(policy, env, n_eval_episodes=1, warn=False)
    (episode,) = rollout(ship_trl.make_env("4"), policy)
    assert reached == pytest.approx(episode.episode_return)


PIXELS = r"policy: 4 takes pixels, uint8 \[84, 84, 1\] or a batch, as gymnasium.make\(..., .*'pixels'"
NUMBERS = r"policy: traffic takes vector, float32 \[158\] or a batch, as gymnasium.make\(..., observ"


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("4", np.zeros(35, np.float32), PIXELS + r".*; got float32 \[35\]"),
        ("4", np.zeros((84, 84, 1), np.float32), PIXELS + r".*; got float32 \[84, 84, 1\]"),
        ("4", np.zeros((84, 84, 3), np.uint8), PIXELS),
        ("4", np.zeros((1, 1, 84, 84, 1), np.uint8), PIXELS),
        ("4", None, PIXELS + ".*; got None"),
        ("traffic", np.zeros((84, 84, 1), np.uint8), NUMBERS),
        ("traffic", np.zeros(34, np.float32), NUMBERS),
        ("traffic", np.zeros(35), NUMBERS),
        ("traffic", np.zeros((2, 2, 35), np.float32), NUMBERS),
        (
            "apf",
            np.zeros(35, np.float32),
            r"policy: apf takes the scene, info\['state'\], float32 \[N, 9",
        ),
        ("apf", np.float32(3), "policy: apf takes the scene"),
    ],
)
def test_other_observations_are_refused(name: str, given: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ship_trl.load_policy(name).predict(given)


def test_it_is_greedy() -> None:
    with pytest.raises(ConfigError, match="deterministic: must be True: traffic acts greedily"):
        ship_trl.load_policy("traffic").predict(np.zeros(35, np.float32), deterministic=False)


def test_a_file_and_a_function_of_ones_own_are_policies(tmp_path: Path) -> None:
    made = make_network(load_network("vector"), 7, Generator().manual_seed(0))
    save_weights(tmp_path / "vector.safetensors", made, {})
    policy = ship_trl.load_policy(tmp_path / "vector.safetensors")
    seen = np.ones((3, 158), np.float32)
    assert policy.predict(seen)[0].tolist() == made(torch.from_numpy(seen)).argmax(-1).tolist()
    (tmp_path / "mine.py").write_text(
        "def policy(env, seed):\n    return lambda step: step.set('action', step['state'][:, 0].long() + 2)\n"
    )
    own = ship_trl.load_policy(f"{tmp_path / 'mine.py'}:policy", case="4")
    assert own.predict(np.zeros((3, 19), np.float32))[0].tolist() == [2, 2, 2]
    with pytest.raises(ConfigError, match=r"mine.py:policy writes action \[9\]; allowed: int64 \[1\] "):
        own.predict(np.full(19, 7, np.float32))
