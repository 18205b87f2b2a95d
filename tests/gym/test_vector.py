"""The vector environment is N of the single ones."""

import re
import subprocess
import sys
import warnings
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray
from torch import Generator, Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.gym.env import ENV_ID, ShipCollisionEnv
from ship_trl.gym.ships import Observations
from ship_trl.gym.vector import ShipCollisionVectorEnv
from ship_trl.sim.starts import Starts
from ship_trl.sim.suites import Perturbation, Suite, load_suite
from tests.command import ROOT, environment


def pair(
    count: int, case: str, colour: bool = False, observation: str = "pixels"
) -> tuple[ShipCollisionVectorEnv, SyncVectorEnv]:
    options: dict[str, Any] = {"colour": colour, "observation": observation, "reward_scale": 0.5}
    single = lambda: ShipCollisionEnv(case, **options)  # noqa: E731
    singles = SyncVectorEnv([single] * count, autoreset_mode=AutoresetMode.SAME_STEP)
    return ShipCollisionVectorEnv(count, case, **options), singles


def alike(got: object, wanted: object) -> None:
    """Compare arrays, also in nested dictionaries."""
    if isinstance(wanted, dict):
        assert isinstance(got, dict)
        for key in wanted:
            # A mask of what every row has says nothing.
            if not (key.startswith("_") and np.asarray(wanted[key]).all()):
                alike(got[key], wanted[key])
    elif isinstance(wanted, np.ndarray) and wanted.dtype == object:
        for one, other in zip(np.asarray(got), wanted, strict=True):
            assert (one is None) == (other is None) and np.array_equal(one, other)
    else:
        np.testing.assert_array_equal(np.asarray(got), np.asarray(wanted))


@pytest.mark.parametrize(
    ("case", "colour", "observation"),
    [("1", False, "pixels"), ("4", False, "pixels"), ("6", True, "pixels"), ("4", False, "vector")],
)
def test_it_is_gymnasiums_vector_of_single_ones(case: str, colour: bool, observation: str) -> None:
    ours, singles = pair(5, case, colour, observation)
    assert ours.single_observation_space == singles.single_observation_space
    assert ours.observation_space == singles.observation_space
    assert ours.single_action_space == singles.single_action_space
    for got, wanted in zip(ours.reset(seed=1), singles.reset(seed=1), strict=True):
        alike(got, wanted)
    draws, ended = np.random.default_rng(3), 0
    for _ in range(220):
        actions = draws.integers(7, size=5)
        # One ship goes straight, so that episodes end at different times.
        actions[0] = 3
        got, wanted = ours.step(actions), singles.step(actions)
        for one, other in zip(got[:4], wanted[:4], strict=True):
            alike(one, other)
        ends = wanted[2] | wanted[3]
        infos = dict(wanted[4])
        if ends.any():
            ended += int(ends.sum())
            # For rows that go on, Gymnasium's final info holds zeros and ours the present values.
            final = infos.pop("final_info")
            for key in ("state", "goal", "collision", "dcpa"):
                alike(got[4]["final_info"][key][ends], final[key][ends])
            alike(got[4]["_final_info"], ends)
        alike(got[4], infos)
    assert ended > 5


def test_returned_arrays_are_not_overwritten() -> None:
    envs = ShipCollisionVectorEnv(3, "4")
    first, _ = envs.reset()
    kept = first.copy()
    _, _, _, _, infos = envs.step(np.array([0, 3, 6]))
    assert np.array_equal(first, kept)
    # Changing a returned array does not change the ships.
    mine, other = ShipCollisionVectorEnv(3, "4"), infos["state"].copy()
    mine.reset()
    infos["state"][:], infos["dcpa"][:] = 0.0, 0.0
    mine.step(np.array([0, 3, 6]))
    _, _, _, _, after = envs.step(np.array([1, 1, 1]))
    _, _, _, _, wanted = mine.step(np.array([1, 1, 1]))
    assert np.array_equal(after["state"], wanted["state"]) and np.array_equal(after["dcpa"], wanted["dcpa"])
    assert not np.array_equal(after["state"], other)


def test_it_is_made_by_name() -> None:
    envs = gymnasium.make_vec(ENV_ID, num_envs=4, vectorization_mode="vector_entry_point", case="2")
    observation, _ = envs.reset(seed=1)
    assert observation.shape == (4, 84, 84, 1) and observation.std() > 0
    assert isinstance(envs.unwrapped, ShipCollisionVectorEnv)


def test_the_documents_line_needs_nothing_before_it() -> None:
    text = (ROOT / "docs/library.md").read_text()
    (name,) = re.findall(r"^    (name = .*)$", text, re.MULTILINE)
    (line,) = re.findall(r"^    (envs = gymnasium\.make_vec.*)$", text, re.MULTILINE)
    code = f"import gymnasium\n{name}\n{line}\nprint(envs.reset()[0].shape, gymnasium.make(name).spec.id)"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, timeout=300
    )
    assert done.stdout.strip() == f"(64, 84, 84, 1) {ENV_ID}", done.stderr


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="num_envs: must be at least 1, got 0"):
        ShipCollisionVectorEnv(0)
    with pytest.raises(ConfigError, match="nowhere"):
        ShipCollisionVectorEnv(2, "nowhere")
    for make in (ShipCollisionEnv, ShipCollisionVectorEnv):
        with pytest.raises(ConfigError, match="observation: must be one of pixels, vector, got sound"):
            make(observation="sound")
    with pytest.raises(IndexError, match="action index out of range"):
        ShipCollisionVectorEnv(2).step(np.array([0, 7]))
    with pytest.raises(ValueError, match="actions: must have the shape"):
        ShipCollisionVectorEnv(2).step(np.array([0, 1, 2]))


@pytest.fixture
def mixed(world: World, monkeypatch: pytest.MonkeyPatch) -> Suite:
    """Let the Gymnasium environments begin with a perturbed suite of seven cases."""
    suite = replace(
        load_suite("paper", world), perturbation=Perturbation(30.0, 20.0, ship_position=100.0, ship_speed=5.0)
    )
    monkeypatch.setattr("ship_trl.gym.ships.load_suite", lambda *_: suite)
    return suite


def begin(single: ShipCollisionEnv, state: Tensor) -> tuple[Observations, NDArray[np.float32]]:
    """Begin an episode in a given state; return picture and state."""
    single.reset()
    ships = single._ships
    ships.state[0] = state.numpy()
    return ships.observe(ships.state)[0], ships.state[0]


def test_a_mixed_perturbed_batch_and_its_resets_equal_single_ships(mixed: Suite, world: World) -> None:
    count, ended, draws = 8, 0, np.random.default_rng(3)
    envs, starts, chance = ShipCollisionVectorEnv(count), Starts(mixed, world), Generator().manual_seed(5)
    pixels, infos = envs.reset(seed=5)
    singles, begun = [ShipCollisionEnv() for _ in range(count)], starts.sample(count, chance)
    alone = [begin(single, state) for single, state in zip(singles, begun, strict=True)]
    for _ in range(90):
        for n, (picture, state) in enumerate(alone):
            assert np.array_equal(pixels[n], picture) and np.array_equal(infos["state"][n], state)
        actions = draws.integers(7, size=count)
        pixels, reward, terminated, truncated, infos = envs.step(actions)
        over = terminated | truncated
        fresh, ended = iter(starts.sample(int(over.sum()), chance)), ended + int(over.sum())
        for n, single in enumerate(singles):
            picture, *result, info = single.step(actions[n])
            assert result == [reward[n], terminated[n], truncated[n]]
            alone[n] = picture, info["state"]
            if over[n]:
                assert np.array_equal(infos["final_obs"][n], picture)
                alike({key: values[n] for key, values in infos["final_info"].items()}, info)
                alone[n] = begin(single, next(fresh))
    assert ended > count


def test_gymnasium_accepts_a_mixed_perturbed_suite(mixed: Suite) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*render modes.*|.*spec is None.*")
        check_env(ShipCollisionEnv(), skip_render_check=True)
    envs = ShipCollisionVectorEnv(6)
    seen = [envs.reset(seed=seed)[0] for seed in (1, 1, 2)]
    assert all(pixels in envs.observation_space for pixels in seen)
    assert np.array_equal(seen[0], seen[1]) and not np.array_equal(seen[0], seen[2])
    assert len({row.tobytes() for row in seen[0]}) == 6 and len(mixed.cases) == 7


def test_a_suite_draws_its_starts_from_the_seed() -> None:
    def starts(seed: int | list[int | None]) -> list[NDArray[np.float32]]:
        envs = ShipCollisionVectorEnv(8, "paper")
        states = [envs.reset(seed=seed)[1]["state"]]
        for _ in range(40):
            _, _, terminated, truncated, infos = envs.step(np.full(8, 3))
            states.append(infos["state"][terminated | truncated])
        return states

    one, same, other = starts(1), starts(1), starts([1, None, 3, 4, 5, 6, 7, 8])
    assert all(np.array_equal(a, b) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one[0], other[0]) and sum(map(len, one)) > 12
    # Without a seed, two environments begin differently.
    unseeded = [ShipCollisionVectorEnv(32, "paper").reset()[1]["state"] for _ in range(2)]
    assert not np.array_equal(*unseeded)
    single = gymnasium.make(f"ship_trl.gym:{ENV_ID}", case="paper")
    first = [single.reset(seed=seed)[1]["state"] for seed in (0, 0, 1, 2, 3)]
    assert np.array_equal(first[0], first[1]) and len({state.tobytes() for state in first}) > 1
