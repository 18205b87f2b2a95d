"""The network that `algorithm.teacher` names: read, refused, and known by its content."""

import json
import shutil
from pathlib import Path

import pytest
import torch
from omegaconf import OmegaConf
from torch import Generator

from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.types import Config
from ship_trl.fast.worlds import make_env
from ship_trl.learn.network import make_network
from ship_trl.policies.named import load_with_network
from ship_trl.policies.pretrained import find
from ship_trl.run.experiment import run_experiment
from ship_trl.run.plan import make_run
from ship_trl.run.setup import read_teacher
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.state import initial_state
from ship_trl.transfer.casebase import POLICY
from ship_trl.transfer.weights import read_look, save_weights
from tests.config.test_config import composed


def pupil(teacher: object, *others: str) -> Config:
    words = ("target=4", "method=scratch", "algorithm=pupil", "profile=smoke", "learn.jumpstart_draws=0")
    return composed(*words, f"algorithm.teacher='{teacher}'", *others)


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
    for name in (path, tmp_path):
        teacher = read_teacher(pupil(name), env)
        assert teacher is not None
        assert torch.equal(teacher(state), wanted)
    bundled = read_teacher(pupil("pretrained:4"), env)
    bundled_tenth = read_teacher(pupil("pretrained:4", "learn.reward_scale=0.01"), env)
    _, own = load_with_network("pretrained:4", env)
    assert bundled is not None and bundled_tenth is not None
    torch.testing.assert_close(bundled_tenth(state), 0.1 * own(env.rasteriser(state)))
    assert read_teacher(composed("target=4", "method=scratch"), env) is None


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
    assert one is not None and tenth is not None
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


def test_an_unusable_teacher_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    text = tmp_path / "text.safetensors"
    text.write_text("not a network")
    three = saved(tmp_path / "three.safetensors", actions=3)
    for path, message in (
        (text, "is not a whole safetensors file"),
        (three, "does not fit the network: advantage.bias has shape (3,), allowed (7,)"),
    ):
        run = make_run(pupil(path))
        with pytest.raises(ConfigError, match=r"^algorithm\.teacher: ") as error:
            run_experiment(run)
        assert message in str(error.value) and not run.folder.exists()
