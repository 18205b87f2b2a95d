"""A model of Stable-Baselines3 is a policy: in a process of its own, and only if it is trusted."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import A2C, PPO

import ship_trl
from ship_trl.config.errors import ConfigError
from ship_trl.gym import ENV_ID
from ship_trl.policies import sb3
from tests.cli.test_evaluate import table


class Mark:
    """Leaves a file where it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path("unpickled").absolute(),)


def test_a_model_acts_and_its_pickles_run_only_if_it_is_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    env = gymnasium.make(ENV_ID, observation="vector")
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=8, seed=0)
    vars(model)["mark"] = Mark()
    model.save("model.zip")
    with pytest.raises(ConfigError, match=r"model.zip holds pickles, .*, write trusted:model\.zip"):
        ship_trl.load_policy("model.zip")
    assert not Path("unpickled").exists()
    policy = ship_trl.load_policy("trusted:model.zip")
    said = capsys.readouterr().err
    assert said == "ship_trl: policy: model.zip: running the code in it, in a process of its own\n"
    assert Path("unpickled").exists() and policy.env_options == {"observation": "vector"}
    seen = np.random.default_rng(0).normal(size=(20, 158)).astype(np.float32)
    wanted, _ = model.predict(seen, deterministic=True)
    assert len(set(wanted.tolist())) > 1 and np.array_equal(policy.predict(seen)[0], wanted)
    assert policy.predict(seen[0])[0] == wanted[0]
    # The table's row is the episode of Gymnasium's environment.
    (row,) = table(capsys, "trusted:model.zip", "target=4")
    (observation, _), total, over = env.reset(), 0.0, False
    while not over:
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, _ = env.step(action)
        total, over = total + float(reward), terminated or truncated
    assert float(row[2]) == pytest.approx(total, abs=0.06)
    for process, _ in [sb3.start(Path("model.zip"), Path("model.zip").stat().st_mtime_ns)]:
        process.kill()
        process.wait()
    with pytest.raises(ConfigError, match=r"policy: model\.zip: its process has ended"):
        policy.predict(seen)


def test_what_is_no_model_for_this_world_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    A2C("MlpPolicy", gymnasium.make("CartPole-v1")).save("cart.zip")
    with pytest.raises(
        ConfigError, match=r"cart.zip: must have observations of .* 7 actions, got float32 \[4\] and 2"
    ):
        ship_trl.load_policy("trusted:cart.zip")
    Path("text.zip").write_text("text")
    with pytest.raises(ConfigError, match=r"text.zip: stable_baselines3 cannot load it"):
        ship_trl.load_policy("trusted:text.zip")
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="needs stable_baselines3, which is not installed"):
        ship_trl.load_policy("trusted:text.zip")
