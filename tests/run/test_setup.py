"""The parts of a run: demonstrations, source, its check during training, teacher."""

import dataclasses
import json
import re
import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
import torch
from omegaconf import OmegaConf
from torch import Generator

from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.types import Config
from ship_trl.fast.worlds import make_env
from ship_trl.files.curve import CURVE
from ship_trl.files.record import read_run
from ship_trl.learn.algorithm import Teacher
from ship_trl.learn.double_dqn import build
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.policies.demonstrations import write_demonstration
from ship_trl.policies.named import load_with_network
from ship_trl.policies.pretrained import find, networks
from ship_trl.policies.reference import best_known
from ship_trl.run import setup
from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import Run, find_teacher, make_run
from ship_trl.run.setup import (
    MAX_EVALUATIONS,
    Source,
    is_measured,
    read_source,
    show_demonstrations,
)
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import initial_state
from ship_trl.transfer.casebase import POLICY
from ship_trl.transfer.weights import read_look, save_weights
from tests.command import SMOKE, files
from tests.config.test_config import composed
from tests.learn.worlds import fast_setup


def test_every_step_of_a_demonstration_is_stored_once(tmp_path: Path) -> None:
    world = load_world()
    case = load_case("4", world)
    plan = best_known(case, world)
    for _ in range(2):
        write_demonstration(tmp_path, case, world, plan.actions, (plan.episode_return, "goal"), "planner")
    words = ["target=4", "method=scratch", f"demonstrations={tmp_path}"]
    run = make_run(composed(*words))
    env, replay = make_env(case, world, 3), Generator().manual_seed(0)
    network = DuelingNetwork(1, 7, Generator().manual_seed(0))
    parts = fast_setup(network, env.rasteriser, 7, run.config.learn, Generator(), replay)
    algorithm = build(parts)
    # Three ships repeat the actions, and the steps of one are kept.
    show_demonstrations(run, env, algorithm)
    assert algorithm.updates == algorithm.steps == 0
    assert len(algorithm.replay) == 2 * len(plan.actions)
    rows = algorithm.replay[:]
    assert rows["action"].tolist() == 2 * plan.actions
    assert abs(float(rows["next", "reward"].sum()) * 10 - 2 * plan.episode_return) < 1e-2
    assert int(rows["next", "done"].sum()) == 2


ACTIONS = "world.actions=[[15,0],[7.5,0.1],[7.5,-0.1]]"


def read(arm: str, folder: Path, world: Sequence[str] = (ACTIONS,)) -> Source | None:
    """Read a source of seven actions, for a world of three by default."""
    file = next(one.file for one in networks() if one.name == "1")
    words = ("source=1", "target=2", f"+arm={arm}", f"source_file={file}", f"output={folder}", *world)
    return read_source(make_run(composed(*words)))


@pytest.mark.parametrize("arm", ["FE3", "FT1", "FTB", "SP3", "GU3"])
def test_a_source_may_have_other_actions_where_its_output_is_not_copied(arm: str, tmp_path: Path) -> None:
    found = read(arm, tmp_path)
    assert found is not None
    assert {key.split(".")[0] for key in found.weights} == {
        "conv1",
        "conv2",
        "conv3",
        "conv4",
        "shared",
        "value",
    }


@pytest.mark.parametrize("arm", ["FTW", "FTH", "G3", "QD"])
def test_a_source_of_other_actions_is_refused_where_its_q_values_are_needed(arm: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"advantage\.bias has shape \(7,\), allowed \(3,\)"):
        read(arm, tmp_path)


LINE = (*SMOKE, "+pair=high", "+arm=FT3")


def planned(*words: str) -> Run:
    return make_run(composed(*words))


@pytest.mark.parametrize(
    ("episodes", "every", "count"),
    [(600, 5, 20), (5000, 50, 20), (95, 5, 20), (9, 3, 4), (10, 3, 5), (1, 7, 2)],
)
def test_at_most_so_many_evaluations_are_measured_evenly(episodes: int, every: int, count: int) -> None:
    learn: Any = SimpleNamespace(episodes=episodes, evaluate_every=every)
    evaluated = sorted({*range(0, episodes, every), episodes})
    due = [number for number, episode in enumerate(evaluated) if is_measured(episode, learn)]
    assert len(due) == count <= MAX_EVALUATIONS and (due[0], due[-1]) == (0, len(evaluated) - 1)
    gaps = {after - before for before, after in pairwise(due)}
    assert max(gaps) - min(gaps) <= 1


@pytest.mark.parametrize("observation", ["pixels", pytest.param("vector", marks=pytest.mark.long)])
def test_what_is_learned_has_the_same_bits_without_it(
    observation: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # No bundled network of case 1 sees vectors, so that source is trained here.
    words = *LINE, f"observation={observation}", *("source=pretrained",) * (observation == "pixels")
    run, other = (planned(*words, f"output={name}") for name in ("one", "other"))
    result = run_experiment(run)
    line = r"^Forgetting on case 1: greedy return (\S+) before, (\S+) after$"
    told = re.search(line, capsys.readouterr().out, re.M)
    assert told is not None and result.on_source is not None
    assert told.groups() == (f"{result.on_source.network:.1f}", f"{result.on_source.final:.1f}")
    run_experiment(dataclasses.replace(other, source_suite=None))
    assert "Forgetting" not in capsys.readouterr().out.partition("case 1 -> case 2")[2]
    kept, left = files(run.folder), files(other.folder)
    for name in ("policy.safetensors", "policy_last.safetensors"):
        assert kept[name] == left[name]
    curve, without = (pd.read_csv(one.folder / CURVE) for one in (run, other))
    assert curve.drop(columns="source_return").equals(without.drop(columns="source_return"))
    assert without["source_return"].isna().all() and curve["source_return"].notna().sum() == 2
    assert read_run(other.folder).on_source is None and run.config_hash == other.config_hash
    measured, source = curve["source_return"].dropna(), result.on_source
    assert source is not None and read_run(run.folder) == result
    assert (source.before, source.final) == (measured.iloc[0], measured.iloc[-1])
    if observation == "pixels":
        assert source.best_known == pytest.approx(source.network, abs=10)
        assert source.random < -100 < 0 < source.network


def pupil(teacher: object, *others: str) -> Config:
    words = ("target=4", "method=scratch", "algorithm=pupil", "profile=smoke", "learn.jumpstart_draws=0")
    return composed(*words, f"algorithm.teacher='{teacher}'", *others)


def read_teacher(config: Config, env: ShipEnv) -> Teacher:
    found = find_teacher(config)
    assert found is not None
    return setup.read_teacher(found, env, config)


def saved(path: Path, seed: int = 0, actions: int = 7) -> Path:
    """Write a network of numbers."""
    network = make_network(load_network("vector"), actions, Generator().manual_seed(seed))
    save_weights(path, network, {})
    return path


def test_a_teacher_of_numbers_and_one_of_pixels_give_their_q_values(tmp_path: Path) -> None:
    world = load_world()
    case = load_case("4", world)
    env, state = make_env(case, world), initial_state(case, world)[None]
    # A result folder holds the network, as a file does.
    path = saved(tmp_path / "policy.safetensors")
    network = make_network(load_network("vector"), 7, Generator().manual_seed(0))
    wanted = network(env.observer(network.config)(state))
    exact = "learn.precision=fp32"
    for name in (path, tmp_path):
        assert torch.equal(read_teacher(pupil(name, exact), env)(state), wanted)
    half = read_teacher(pupil(path, "learn.precision=bf16"), env)(state)
    assert 0 < float((half - wanted).detach().abs().max()) < 0.05
    bundled_tenth = read_teacher(pupil("pretrained:4", exact, "learn.reward_scale=0.01"), env)
    _, own = load_with_network("pretrained:4", env)
    torch.testing.assert_close(bundled_tenth(state), 0.1 * own(env.rasteriser(state)))
    assert find_teacher(composed("target=4", "method=scratch")) is None


def test_it_is_known_by_its_content_and_named_in_the_result(tmp_path: Path) -> None:
    one, other = saved(tmp_path / "one.safetensors"), saved(tmp_path / "other.safetensors", seed=1)
    copy = shutil.copy(one, tmp_path / "copy.safetensors")
    first, second, third = (make_run(pupil(path)).config_hash for path in (one, copy, other))
    assert first == second != third
    bundled = find("pretrained:4", None)
    alike = (make_run(pupil(name, "learn.reward_scale=0.1")) for name in ("pretrained:4", bundled.file))
    assert len({run.config_hash for run in alike}) == 1
    run = make_run(pupil(one, "learn.episodes=2", "network.vector_time=8"))
    result = run_experiment(run)
    assert read_look(run.folder / POLICY, "policy")[0].vector_time == 8
    assert result.teacher is not None and result.teacher.startswith(f"{one} sha256=")
    assert json.loads((run.folder / "result.json").read_text())["teacher"] == result.teacher


def test_a_result_folder_has_the_runs_world_and_its_own_scale_of_rewards(tmp_path: Path) -> None:
    saved(tmp_path / "policy.safetensors")
    config = composed("target=4", "method=scratch", "learn.reward_scale=0.1")
    OmegaConf.save(OmegaConf.structured(config), tmp_path / "config.yaml")
    world = load_world()
    env, state = make_env(load_case("4", world), world), initial_state(load_case("4", world), world)[None]
    one, tenth = (read_teacher(pupil(tmp_path, f"learn.reward_scale={scale}"), env) for scale in (0.1, 0.01))
    torch.testing.assert_close(one(state), 10 * tenth(state))
    hashes = {
        make_run(pupil(name, "learn.reward_scale=0.01")).config_hash for name in (tmp_path, tmp_path / POLICY)
    }
    assert len(hashes) == 1
    # Beside a file of another name, config.yaml may be anybody's.
    own = saved(tmp_path / "own.safetensors")
    (tmp_path / "config.yaml").write_text("world: none")
    assert make_run(pupil(own)).config_hash
    OmegaConf.save(OmegaConf.structured(config), tmp_path / "config.yaml")
    with pytest.raises(ConfigError, match=r"of another world: world.turn_time=0.0; allowed: the same world"):
        make_run(pupil(tmp_path, "world.turn_time=4"))


@pytest.mark.parametrize(
    ("teacher", "message"),
    [
        ("none.safetensors", "no file none.safetensors; allowed: a safetensors file, a result folder,"),
        ("pretrained", "no file pretrained; allowed: a safetensors file"),
        ("pretrained:9", "no bundled network of case 9; allowed: 1, 2"),
        (".", "no file policy.safetensors; allowed"),
    ],
)
def test_a_missing_teacher_is_refused_before_torch_is_needed(teacher: str, message: str) -> None:
    with pytest.raises(ConfigError, match=r"^algorithm\.teacher: ") as error:
        make_run(pupil(teacher))
    assert message in str(error.value) and "\n" not in str(error.value)
