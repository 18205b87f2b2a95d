"""Gymnasium: one ship, and many as the vector of single ones."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pygame
import pytest
import torch
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import vector as wrappers
from hypothesis import given, settings, strategies
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.env_checker import check_env as check_sb3
from torchrl.envs import GymWrapper

from ship_trl import make_env
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.gym import ENV_ID, ShipCollisionEnv, ShipCollisionVectorEnv
from ship_trl.sim.cases import GIVES_WAY, RecordedShip, load_case, load_world
from ship_trl.sim.state import HEADING, OWN_SIZE, SHIP_BEHAVIOUR, SHIP_COUNT
from ship_trl.sim.vector import VectorObservation
from tests.command import ROOT
from tests.forked import run_script
from tests.formats import traffic

KEYS = ("state", "goal", "collision", "least_distance")


@cache
def pair(
    count: int, case: str, mode: AutoresetMode, colour: bool = False, observation: str = "pixels"
) -> tuple[ShipCollisionVectorEnv, SyncVectorEnv]:
    options: dict[str, Any] = {"colour": colour, "observation": observation, "reward_scale": 0.5}
    single = lambda: ShipCollisionEnv(case, **options)  # noqa: E731
    singles = SyncVectorEnv([single] * count, autoreset_mode=mode)
    return ShipCollisionVectorEnv(count, case, autoreset_mode=mode, **options), singles


def compare_infos(got: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Compare infos in the rows that Gymnasium's masks name; in the others it has zeros."""
    for key in KEYS:
        rows = wanted[f"_{key}"]
        np.testing.assert_array_equal(got[key][rows], wanted[key][rows])
        # Without a mask all rows count.
        assert np.array_equal(got.get(f"_{key}", np.ones_like(rows)), rows)


def compare(got: tuple[Any, ...], wanted: tuple[Any, ...]) -> None:
    """Compare what `reset` or `step` returns."""
    for one, other in zip(got[:-1], wanted[:-1], strict=True):
        np.testing.assert_array_equal(one, other)
    ours, theirs = got[-1], dict(wanted[-1])
    assert ours.keys() >= {key for key in theirs if not key.startswith("_")}
    if "final_info" in theirs:
        over = theirs["_final_info"]
        for key in KEYS:
            np.testing.assert_array_equal(ours["final_info"][key][over], theirs["final_info"][key][over])
        for one, other in zip(ours["final_obs"], theirs["final_obs"], strict=True):
            assert (one is None) == (other is None) and np.array_equal(one, other)
        assert np.array_equal(ours["_final_info"], over) and np.array_equal(ours["_final_obs"], over)
    compare_infos(ours, theirs)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(
    ("case", "colour", "observation"),
    [("4", False, "pixels"), ("6", True, "pixels"), ("paper", False, "vector"), ("traffic", False, "vector")],
)
@settings(max_examples=1, deadline=None)
@given(first=strategies.integers(0, 2**40), draws=strategies.integers(0, 2**32))
def test_it_is_gymnasiums_vector_of_single_ones(
    case: str, colour: bool, observation: str, mode: AutoresetMode, first: int, draws: int
) -> None:
    count, ended = 3, 0
    ours, singles = pair(count, case, mode, colour, observation)
    assert ours.single_observation_space == singles.single_observation_space
    assert ours.observation_space == singles.observation_space
    assert ours.single_action_space == singles.single_action_space
    compare(ours.reset(seed=first), singles.reset(seed=first))
    random = np.random.default_rng(draws)
    for _ in range(65):
        actions = random.integers(7, size=count)
        # One ship goes straight, so that episodes end at different times.
        actions[0] = 3
        got, wanted = ours.step(actions), singles.step(actions)
        compare(got, wanted)
        over = wanted[2] | wanted[3]
        ended += int(over.sum())
        if mode is AutoresetMode.DISABLED and over.any():
            seeds: list[int | None] = [None, 7, first]
            # Gymnasium's takes the mask out of the options.
            again = [envs.reset(seed=seeds, options={"reset_mask": over}) for envs in (ours, singles)]
            compare(*again)
    assert ended > 2


def test_a_row_has_the_scene_of_its_seed() -> None:
    def scenes(seeds: list[int]) -> list[NDArray[np.float32]]:
        return [ShipCollisionEnv("traffic").reset(seed=seed)[1]["state"] for seed in seeds]

    envs = ShipCollisionVectorEnv(3, "traffic")
    assert np.array_equal(envs.reset(seed=[5, 6, 7])[1]["state"], scenes([5, 6, 7]))
    assert np.array_equal(envs.reset(seed=np.int64(4))[1]["state"], scenes([4, 5, 6]))  # type: ignore[arg-type]
    assert len({scene.tobytes() for scene in scenes([4, 5, 6, 7])}) == 4
    # None goes on with the row's random numbers, as a reset without a seed does.
    single = ShipCollisionEnv("traffic")
    single.reset(seed=5)
    after = envs.reset(seed=[9, None, 9])[1]["state"]
    assert np.array_equal(after[1], single.reset()[1]["state"])
    assert np.array_equal(after[[0, 2]], scenes([9, 9]))
    # Without a seed two environments begin differently.
    unseeded = [ShipCollisionVectorEnv(32, "paper").reset()[1]["state"] for _ in range(2)]
    assert not np.array_equal(*unseeded)


def test_a_mask_resets_those_rows_alone() -> None:
    envs = ShipCollisionVectorEnv(3, "4", autoreset_mode="Disabled")
    start = envs.reset()[1]["state"]
    moved = envs.step(np.array([3, 3, 3]))[4]["state"]
    rows = np.array([False, True, False])
    options = {"reset_mask": rows}
    _, infos = envs.reset(options=options)
    assert np.array_equal(infos["state"], np.where(rows[:, None], start, moved))
    assert np.array_equal(infos["_state"], rows) and options["reset_mask"] is rows
    for _ in range(60):
        over = np.logical_or(*envs.step(np.array([3, 0, 3]))[2:4])
        if over.any():
            break
    with pytest.raises(ResetNeeded, match=r"episodes \[0, 2\] have ended; reset them first"):
        envs.step(np.array([3, 0, 3]))
    envs.reset(options={"reset_mask": over})
    envs.step(np.array([3, 0, 3]))


@pytest.mark.parametrize(
    ("mode", "wrapper"),
    [
        ("NextStep", wrappers.NormalizeObservation),
        ("NextStep", wrappers.FlattenObservation),
        ("Disabled", wrappers.FlattenObservation),
        *((mode.value, wrappers.RecordEpisodeStatistics) for mode in AutoresetMode),
        *((mode.value, wrappers.DictInfoToList) for mode in AutoresetMode),
    ],
)
def test_gymnasiums_wrappers_take_it(mode: str, wrapper: Callable[[Any], Any]) -> None:
    ours, theirs = (wrapper(envs) for envs in pair(2, "4", AutoresetMode(mode), observation="vector"))
    assert np.array_equal(ours.reset(seed=1)[0], theirs.reset(seed=1)[0])
    for _ in range(18 if mode == "Disabled" else 50):
        got, wanted = ours.step(np.array([3, 0])), theirs.step(np.array([3, 0]))
        assert all(np.array_equal(one, other) for one, other in zip(got[:4], wanted[:4], strict=True))
        if "episode" in wanted[4]:
            assert all(np.array_equal(got[4]["episode"][key], wanted[4]["episode"][key]) for key in "rl")


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_torchrl_wraps_it(mode: str) -> None:
    envs = ShipCollisionVectorEnv(2, "3", observation="vector", autoreset_mode=mode)
    env = GymWrapper(envs, categorical_action_encoding=True)
    straight = lambda *_: torch.full((2,), 3)  # noqa: E731
    steps = env.rollout(40, straight, break_when_any_done=False)
    # An episode lasts 19 steps.
    assert steps["next", "done"][..., 0].nonzero()[:, 1].tolist() == [18, 37, 18, 37]
    first = torch.from_numpy(envs.reset()[0])
    assert torch.equal(steps["observation"][:, [0, 19, 38]], first[:, None].expand(-1, 3, -1))
    assert not torch.equal(steps["next", "observation"][:, 18], first)


def test_returned_arrays_are_not_overwritten() -> None:
    envs = ShipCollisionVectorEnv(3, "4")
    first, _ = envs.reset()
    kept = first.copy()
    _, _, _, _, infos = envs.step(np.array([0, 3, 6]))
    assert np.array_equal(first, kept)
    # Changing a returned array does not change the ships.
    mine, other = ShipCollisionVectorEnv(3, "4"), infos["state"].copy()
    mine.reset()
    infos["state"][:], infos["least_distance"][:] = 0.0, 0.0
    mine.step(np.array([0, 3, 6]))
    _, _, _, _, after = envs.step(np.array([1, 1, 1]))
    _, _, _, _, wanted = mine.step(np.array([1, 1, 1]))
    assert all(np.array_equal(after[key], wanted[key]) for key in ("state", "least_distance"))
    assert not np.array_equal(after["state"], other)


def test_the_documents_line_needs_nothing_before_it(tmp_path: Path) -> None:
    text = (ROOT / "docs/library.md").read_text()
    (name,) = re.findall(r"^    (name = .*)$", text, re.MULTILINE)
    (line,) = re.findall(r"^    (envs = gymnasium\.make_vec.*)$", text, re.MULTILINE)
    # As in a process that has not imported it.
    before = f"import sys, gymnasium\ndel sys.modules['ship_trl.gym'], gymnasium.registry['{ENV_ID}']"
    after = "print(envs.reset()[0].shape, gymnasium.make(name).spec.id)"
    (tmp_path / "lines.py").write_text(f"{before}\n{name}\n{line}\n{after}\n")
    ended = run_script(tmp_path / "lines.py", folder=tmp_path)
    assert ended.out.strip() == f"(64, 84, 84, 1) {ENV_ID}", ended


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (ShipCollisionEnv, {"observation": "sound"}, "observation: must be 'pixels' or 'vector', got"),
        (ShipCollisionEnv, {"render_mode": "ansi"}, "render_mode: must be None or rgb_array, got 'ansi'"),
        (ShipCollisionEnv, {"max_episode_steps": 0}, "max_episode_steps: must be greater than or equal to 1"),
        (ShipCollisionEnv, {"max_episode_steps": [5]}, r"max_episode_steps: must be .*, got \[5\]"),
        (
            ShipCollisionEnv,
            {"config": 5},
            "config: must be a group of world, traffic, perturbation, situations, got 5",
        ),
        (
            ShipCollisionEnv,
            {"config": {"dt": 1}},
            "config.dt: unknown key; allowed here: world, traff",
        ),
        (
            ShipCollisionEnv,
            {"config": {"world": {"dtt": 1}}},
            "world.dtt: unknown key; allowed here: dt, m",
        ),
        (
            ShipCollisionEnv,
            {"config": {"world": {"reward": {"w1": "x"}}}},
            "world.reward.w1: must be a ",
        ),
        (
            ShipCollisionEnv,
            {"config": {"world": {"dt": 0.5}}},
            "goal: cannot be reached: 540 m to go, but",
        ),
        (
            ShipCollisionVectorEnv,
            {"config": {"traffic": {"reacting": 1}}},
            "traffic: case 4 draws no ships; allowed: suite traffic, or another of random encounters",
        ),
        (
            ShipCollisionVectorEnv,
            {"case": "traffic", "config": {"traffic": {"reacting": 2}}},
            "traffic.reacting: must be less than or equal to 1, got 2",
        ),
        (ShipCollisionVectorEnv, {"num_envs": 0}, "num_envs: must be at least 1, got 0"),
        (ShipCollisionVectorEnv, {"case": "nowhere"}, "nowhere"),
        (
            ShipCollisionVectorEnv,
            {"autoreset_mode": "never"},
            "autoreset_mode: must be 'NextStep', 'SameStep' or",
        ),
    ],
)
def test_bad_input_is_refused(make: Callable[..., Any], options: dict[str, Any], message: str) -> None:
    with pytest.raises((ConfigError, ValueError), match=message):
        make(**options)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ([0, 7], "must be whole numbers from 0 to 6, got 7"),
        ([-1, 0], "must be whole numbers from 0 to 6, got -1"),
        ([0, 1, 2], r"of shape \(2,\), got int64 \(3,\)"),
        ([1.0, 2.0], r"of shape \(2,\), got float64 \(2,\)"),
        ([True, False], r"of shape \(2,\), got bool \(2,\)"),
    ],
)
def test_what_are_no_actions_is_refused(actions: Any, message: str) -> None:
    envs, one = ShipCollisionVectorEnv(2), ShipCollisionEnv("4")
    before = envs.reset()[1]["state"]
    with pytest.raises(ValueError, match=message):
        envs.step(actions)
    with pytest.raises(ValueError, match="must be whole numbers from 0 to 6"):
        one.step(actions)
    assert np.array_equal(envs.step(np.array([3, 3]))[4]["state"][:, 7], before[:, 7] + 1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"seed": [1, 2]}, "seed: must be one number or a list of 3, got a list of 2"),
        ({"seed": [1, 2, 3, 4]}, "seed: must be one number or a list of 3, got a list of 4"),
        ({"seed": -1}, "seed: must be a whole number from 0 to .*, got -1"),
        ({"seed": 2**64 - 2}, "seed: must be a whole number from 0 to .*, got 18446744073709551616"),
        ({"seed": 1.5}, "seed: must be a whole number from 0 to .*, got 1.5"),
        ({"seed": [1, "a", 2]}, "seed: must be a whole number from 0 to .*, got 'a'"),
        ({"options": {"reset_mask": np.zeros(3, bool)}}, r"reset_mask: must be bool \[3\] with at least one"),
        ({"options": {"reset_mask": np.ones(2, bool)}}, r"reset_mask: .*, got bool \[2\]"),
        ({"options": {"reset_mask": [1, 0, 0]}}, r"reset_mask: .*, got int64 \[3\]"),
    ],
)
def test_wrong_seeds_and_masks_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ShipCollisionVectorEnv(3, "paper").reset(**given)


def test_an_episode_is_truncated_by_the_world_or_sooner_by_gymnasium() -> None:
    longer = {"world": {"max_steps": 100}}
    cases: tuple[tuple[dict[str, Any], int], ...] = (
        ({}, 60),
        ({"max_episode_steps": 5}, 5),
        ({"max_episode_steps": -1}, 60),
        ({"max_episode_steps": 70}, 60),
        ({"config": longer}, 100),
        ({"config": longer, "max_episode_steps": 80}, 80),
    )
    for options, length in cases:
        for kind in ("vector_entry_point", "sync"):
            envs = gymnasium.make_vec(
                ENV_ID, 2, vectorization_mode=kind, case="2", observation="vector", **options
            )
            envs.reset()
            steps = [envs.step(np.array([0, 0])) for _ in range(length)]
            assert [n for n, (*_, truncated, _) in enumerate(steps, 1) if truncated[0]] == [length], options
            # A vector tells the time left, in minutes; of a single one Gymnasium's wrapper does not tell it.
            known = length if kind != "sync" else 100 if "config" in options else 60
            left = [float(seen[0, 5]) for seen, *_ in steps[:-1]]
            assert left == pytest.approx([min((known - n) / 60, 1) for n in range(1, length)])


def test_a_configuration_changes_world_and_traffic() -> None:
    config = {"world": {"dt": 0.5, "max_steps": 120, "reward": {"goal": 500.0}}}
    makers: tuple[Any, ...] = (gymnasium.make, gymnasium.make_vec)
    for make in makers:
        env = make(f"ship_trl.gym:{ENV_ID}", case="2", config=config)
        assert env.spec.kwargs["config"] == config
        env.reset()
        action, rewards, ended = np.full(env.action_space.shape, 3), list[float](), False
        while not ended:
            _, reward, terminated, _, _ = env.step(action)
            rewards.append(float(np.squeeze(reward)))
            ended = bool(np.all(terminated))
        # 540 m at 15 m/s, half a second each.
        assert len(rewards) == 72 and rewards[-1] - rewards[-2] == pytest.approx(500, abs=1)
    ships = {"traffic": {"ships": [0, 0, 0, 0, 1], "reacting": 1}}
    state = ShipCollisionVectorEnv(2, "traffic", config=ships).reset(seed=1)[1]["state"]
    assert (state[:, SHIP_COUNT] == 4).all() and (state[:, OWN_SIZE + SHIP_BEHAVIOUR] == GIVES_WAY).all()
    assert make_env("traffic", num_envs=2, config=ships).reset()["state"].shape == state.shape
    turned = ShipCollisionEnv("4", config={"perturbation": {"own_heading": 5}}).reset(seed=1)[1]["state"]
    assert turned[HEADING] != ShipCollisionEnv().reset(seed=1)[1]["state"][HEADING]
    with pytest.raises(ConfigError, match="config: must be left out without the name of a case or suite"):
        make_env(load_case("4", load_world()), config={})


def test_encounters_of_other_tools_are_cases_and_their_keys_count(tmp_path: Path) -> None:
    case = str(traffic.write(tmp_path / "day.csv", traffic.make(traffic.CROSSING), "danish"))
    config = {"situations": {"targets": "replay", "safe": 0.2}}
    (ship,) = ShipCollisionVectorEnv(1, case, config=config).suite.case.target_ships
    assert isinstance(ship, RecordedShip)
    for env in (ShipCollisionEnv(case, config=config), gymnasium.make(ENV_ID, case=case, config=config)):
        env.reset(seed=0)
        *_, info = env.step(np.int64(3))
        np.testing.assert_allclose(info["state"][OWN_SIZE : OWN_SIZE + 2], ship.path[0], atol=1e-3)
    batch = make_env(case, num_envs=2, config=config)
    state = batch.rollout(1)["next", "state"][:, 0]
    np.testing.assert_allclose(state[:, OWN_SIZE : OWN_SIZE + 2], [ship.path[0]] * 2, atol=1e-3)
    other = ShipCollisionVectorEnv(2, case, config={"situations": {"own": "both"}})
    assert len(other.suite.cases) == 2 and other.reset(seed=0)[1]["state"].shape[0] == 2


def test_it_draws_a_large_picture_of_each_row() -> None:
    envs = gymnasium.make_vec(ENV_ID, num_envs=2, case="4", render_mode="rgb_array")
    single = ShipCollisionEnv("4", render_mode="rgb_array")
    envs.reset()
    single.reset()
    pictures, wanted = envs.render(), single.render()
    assert pictures is not None and wanted is not None and wanted.shape == (600, 600, 3)
    assert all(np.array_equal(np.asarray(picture), wanted) for picture in pictures)
    assert ShipCollisionVectorEnv(2).render() is None


def test_all_checks_of_gymnasium_pass_in_every_render_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make(f"ship_trl.gym:{ENV_ID}", case="traffic")
    check_env(env.unwrapped)
    # By default there are ships.
    assert ShipCollisionEnv().reset()[1]["state"][SHIP_COUNT] == 2


@pytest.mark.filterwarnings("error:.*HumanRendering")
def test_a_window_shows_each_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env, drawn = (gymnasium.make(ENV_ID, case="4", render_mode=mode) for mode in ("human", "rgb_array"))
    for step in range(3):
        shown, wanted = ((one.step(np.int64(3)) if step else one.reset())[0] for one in (env, drawn))
        assert np.array_equal(shown, wanted)
        window, picture = pygame.display.get_surface(), np.asarray(drawn.render())
        assert window is not None and np.array_equal(pygame.surfarray.array3d(window).swapaxes(0, 1), picture)
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()


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


@pytest.mark.parametrize(("colour", "vector_time"), [(False, 0.0), (True, 0.0), (False, 8.0)])
def test_it_shows_what_the_network_sees_channels_last(colour: bool, vector_time: float) -> None:
    env, world = ShipCollisionEnv(case="4", colour=colour, vector_time=vector_time), load_world()
    env.reset()
    observation, _, _, _, info = env.step(np.int64(0))
    draw = make_rasteriser(world, colour=colour, vector_time=vector_time)
    picture = draw(torch.from_numpy(info["state"]))
    assert np.array_equal(np.moveaxis(observation, -1, 0), picture.numpy())


def test_as_a_vector_it_gives_the_numbers_of_the_networks() -> None:
    env, observe = gymnasium.make(ENV_ID, case="traffic", observation="vector"), VectorObservation
    check_sb3(env.unwrapped, warn=True)
    wanted = observe.of(load_network("vector"), load_world())
    for observation, info in (env.reset(seed=3), env.step(np.int64(0))[::4]):
        assert observation in env.observation_space and observation.dtype == np.float32
        np.testing.assert_allclose(observation, wanted(torch.from_numpy(info["state"])), rtol=0, atol=2e-6)
