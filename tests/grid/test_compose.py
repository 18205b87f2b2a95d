"""Words of a command line stay as they are typed, and a suite brings its profile however it is named."""

from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

from ship_trl.config.checks import to_config
from ship_trl.config.paths import conf_dir
from ship_trl.grid.compose import Loader, read_word
from tests.command import ship_trl

TRAFFIC = "# @package _global_\ntarget: traffic\nmethod: scratch\noutput: 2024_05_01\nseed: 010\n"
PROFILE = """\
# @package _global_
defaults: [override /recipe: double_dqn_quick]
profile: mine
output: outputs
learn: {episodes: 7}
"""


@pytest.fixture(autouse=True)
def _as_the_command_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hydra._internal.hydra.ConfigLoaderImpl", Loader)


def composed(*words: str) -> Any:
    folder = Path("own/experiment")
    folder.mkdir(parents=True)
    (folder / "2024_05_01.yaml").write_text(TRAFFIC)
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        found = compose("config", [f"hydra.searchpath=[file://{Path('own').absolute()}]", *words])
    assert isinstance(found, DictConfig)
    return to_config(found)


@pytest.mark.parametrize(
    ("words", "profile", "episodes"),
    [
        *(([word, "method=scratch"], "traffic", 208000) for word in ("target=traffic", 'target="traffic"')),
        *(([word, "method=scratch"], "traffic", 208000) for word in ("++target=traffic", "target='traffic'")),
        (["target=traffic_reacting", "method=scratch"], "traffic", 208000),
        (["+experiment=2024_05_01"], "traffic", 208000),
        (["source=traffic", "target=imazu", "layers=1"], "traffic", 208000),
        (["source=4", "target=traffic", "layers=1"], "traffic", 208000),
        (["target=traffic", "method=scratch", "profile=quick"], "quick", 600),
        (["+pair=high", "layers=1"], "quick", 600),
    ],
)
def test_a_suite_brings_its_profile(words: list[str], profile: str, episodes: int) -> None:
    config = composed(*words)
    assert (config.profile, config.learn.episodes) == (profile, episodes)


def test_each_run_of_a_grid_takes_its_own_profile(tmp_path: Path) -> None:
    grid = ("-m", "hydra/launcher=basic", "method=scratch", "learn.batch_size=${learn.replay_size}x")
    for targets, most in (("choice(traffic)", 1500000), ("traffic,4", 1500000), ("4,traffic", 10000)):
        said = ship_trl(*grid, f"target={targets}", folder=tmp_path, code=1).stderr
        assert said == f'ship_trl: learn.batch_size: must be a valid integer, got "{most}x"\n'


def test_keys_of_text_take_the_word_as_typed() -> None:
    names = ("output=2024_05_01", "target=1_0", "wandb.project=1e3", "+wandb.group=010", "wandb.entity=true")
    config = composed(*names, "method=scratch", "case_base=-1", "seed=010", "learn.lr=1e-3")
    wandb = config.wandb
    assert (config.output, config.target, config.case_base) == ("2024_05_01", "1_0", "-1")
    assert (wandb.project, wandb.group, wandb.entity) == ("1e3", "010", "true")
    assert (config.seed, config.learn.lr, config.source) == (10, 1e-3, None)


@pytest.mark.parametrize(
    ("word", "wanted"),
    [
        ("output=1e3,2_0, x", "output='1e3','2_0', x"),
        ("output=choice(1e3,true)", "output=choice('1e3','true')"),
        ("hydra/launcher=5", "hydra/launcher='5'"),
        ("algorithm.teacher=1e3", "++algorithm.teacher='1e3'"),
        ("hydra.sweep.dir=2024_05_01", "hydra.sweep.dir='2024_05_01'"),
        *((word, word) for word in ("source=null", "target=range(1,4)", "output='1e3'", "output=${seed}/1")),
        *(
            (word, word)
            for word in ("seed=1_0", "learn.lr=1e-3", "layers=3", "fast=true", "~output", "a.b=1")
        ),
        ("learn.typo.x=1", "learn.typo.x=1"),
    ],
)
def test_only_words_of_text_keys_are_quoted(word: str, wanted: str) -> None:
    assert read_word(word) == wanted


OWN = """\
# @package _global_
defaults: [double_dqn, _self_]
algorithm:
  build: own.py:build
learn:
  backend: dense
  lr: 0.125
"""


def test_files_of_ones_own_set_any_value_of_training() -> None:
    for group, text in (("algorithm", OWN), ("profile", PROFILE)):
        (Path("own") / group).mkdir(parents=True)
        (Path("own") / group / "mine.yaml").write_text(text)
    Path("own.py").touch()
    words = ("target=1", "method=scratch", "profile=mine", "algorithm=mine")
    learn = composed(*words).learn
    assert (learn.backend.value, learn.lr, learn.episodes, learn.tau) == ("dense", 0.125, 7, 0.02)
