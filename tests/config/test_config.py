"""Every group of conf/ composes to a valid configuration."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.arm import Arm
from ship_trl.config.checks import ignored_keys, named_learn, non_default_algorithm, to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Config, Observation, plain
from ship_trl.files.untrusted import read_changes, read_yaml
from ship_trl.grid.compose import compose_config, use_loader
from ship_trl.run.plan import make_run

HIGH = ["+pair=high", "method=finetune", "layers=3"]
ALGORITHMS = ("double_dqn", "n_step", "ppo", "pupil")


# Words that choose files or need Hydra's grammar; others set a value.
CHOICE = re.compile(
    r"[+~]|hydra\.|\w*/|(arm|algorithm|network|observation|pair|profile|recipe|source|target|world)=|.*[$']"
)


@cache
def composed_choices(*words: str) -> DictConfig:
    """Compose files, which takes Hydra 0.3 seconds, and check nothing."""
    GlobalHydra.instance().clear()
    use_loader()
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        return compose("config", list(words))


@cache
def composed(*words: str) -> Config:
    """Compose as `compose_config` does, with the files of each choice composed once."""
    values = [word for word in words if not CHOICE.match(word)]
    try:
        chosen = composed_choices(*(word for word in words if word not in values))
        merged = OmegaConf.merge(chosen, read_changes(values))
    except (HydraException, OmegaConfBaseException):  # which it explains
        return compose_config(*words)
    assert isinstance(merged, DictConfig)
    return to_config(merged)


def options(group: str) -> list[str]:
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def test_the_main_command_is_composed() -> None:
    config = composed(*HIGH)
    assert (config.source, config.target, config.arm) == ("1", "2", Arm("finetune", 3))
    assert (config.label, config.arm_label, config.output) == ("high", "FT3", "outputs")
    assert config.profile == "quick" and to_config(OmegaConf.create(plain(config))) == config
    more = (*HIGH, "seed=1", "output=a/b", "learn.lr=1e-3", "network.hidden=9", "world.actions=[[9,0],[5,1]]")
    assert composed(*more) == compose_config(*more)


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["arm=FT3"], "FT3"),
        (["source_weights=random", "+arm=FE3"], "FE3-random"),
        (["arm=FT3", "layers=2"], "FT2"),
        (["arm=scratch"], "scratch"),
    ],
)
def test_an_arm_is_one_word(words: list[str], name: str) -> None:
    assert composed("+pair=high", *words).arm == Arm.parse(name)


@pytest.mark.parametrize("pair", options("pair"))
def test_every_pair_composes(pair: str) -> None:
    config = composed(f"+pair={pair}", "layers=all")
    assert config.label == pair and config.arm_label == "FTW"
    assert make_run(config).source is not None


@pytest.mark.parametrize("profile", options("profile"))
def test_every_profile_composes(profile: str) -> None:
    assert composed(*HIGH, f"profile={profile}").profile == profile


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_every_recipe_sets_all_values_of_training_once(algorithm: str) -> None:
    # A profile of one's own may name any recipe, and may do without those of other algorithms.
    found = [name for name in options("recipe") if name.startswith(f"{algorithm}_")]
    profiles = {name.removeprefix(f"{algorithm}_") for name in found}
    assert profiles >= {"long", "paper", "quick", "smoke", "traffic"}
    for profile in profiles:
        words = ["algorithm.teacher=pretrained:4"] if algorithm == "pupil" else []
        config = plain(composed(*HIGH, f"profile={profile}", f"algorithm={algorithm}", *words))
        name = f"double_dqn_{profile}" if algorithm == "n_step" else f"{algorithm}_{profile}"
        recipe: Any = read_yaml(conf_dir() / "recipe" / f"{name}.yaml")
        assert recipe.learn == {key: config["learn"][key] for key in recipe.learn}
        assert config["learn"].keys() - recipe.learn.keys() == {"precision", "backend"}


def test_some_profiles_have_an_algorithm_and_a_picture() -> None:
    long = composed(*HIGH, "profile=long")
    assert (long.algorithm["steps"], long.learn.episodes) == (5, 1500)
    pixels, numbers = (
        composed("target=traffic", "method=scratch", *more) for more in ((), ("observation=vector",))
    )
    assert (pixels.network.vector_time, pixels.colour, pixels.margin.timeout) == (8, True, 0)
    assert (numbers.network, numbers.colour) == (load_network("vector"), False)
    assert numbers.margin.timeout > 0


@pytest.mark.parametrize("network", options("network"))
def test_every_network_composes_with_as_many_layers_as_it_has(network: str) -> None:
    seen = Observation.vector if load_network(network).linear else Observation.pixels
    high = ("+pair=high", f"observation={seen}", f"network={network}")
    count = load_network(network).depth
    assert composed(*high, f"arm=FE{count}").arm_label == f"FE{count}"
    with pytest.raises(ConfigError, match=rf"^layers: must be 1, .*{count}.* got {count + 1};"):
        composed(*high, f"layers={count + 1}")


def test_an_observation_chooses_its_network_unless_another_is_given() -> None:
    assert composed(*HIGH, "observation=vector").network == load_network("vector")
    # A group on the command line goes before the one that an observation overrides.
    with pytest.raises(ConfigError, match="got vector"):
        composed(*HIGH, "network=five", "observation=vector")
    with pytest.raises(ConfigError, match=r"^observation: must be vector with network\.linear, got pixels"):
        composed(*HIGH, "network=vector")


def test_whole_numbers_are_accepted_as_actions() -> None:
    whole, real = (
        composed(*HIGH, f"world.actions={rows}") for rows in ("[[10,0.1],[5,0]]", "[[10.0,0.1],[5.0,0.0]]")
    )
    assert whole == real and all(type(v) is float for row in whole.world.actions for v in row)
    assert make_run(whole).config_hash == make_run(real).config_hash


def test_keys_that_an_algorithm_does_not_read_are_named() -> None:
    words = ["target=4", "learn.tau=0.1", "learn.gamma=0.9", "+margin.penalty=1", "learn.lr=1e-4"]
    found = {
        name: ignored_keys({"build": f"ship_trl.learn.{name}:build"}, words)
        for name in ("ppo", "pupil", "n_step")
    }
    assert found == {"ppo": ["learn.tau"], "pupil": ["learn.gamma", "margin.penalty"], "n_step": []}


def test_a_builder_of_ones_own_takes_any_keys() -> None:
    Path("mine.py").write_text("")
    values = composed(*HIGH, "algorithm.build='mine.py:build'", "+algorithm.steps=[1,{deep: 2}]").algorithm
    assert values == {"build": "mine.py:build", "steps": [1, {"deep": 2}]}
    assert non_default_algorithm(values) == values


def test_files_name_imitation_only_where_there_is_some() -> None:
    without, some = (composed(*HIGH, "algorithm=ppo", f"profile={name}") for name in ("quick", "long"))
    keys = {"imitation_coeff", "imitation_start"}
    assert non_default_algorithm(without.algorithm) == {
        key: value for key, value in without.algorithm.items() if key not in keys
    }
    assert non_default_algorithm(some.algorithm) == some.algorithm and keys < set(some.algorithm)


def test_files_do_not_name_the_backend() -> None:
    learn = composed(*HIGH).learn
    assert plain(learn).keys() - named_learn(learn).keys() == {"backend"}
