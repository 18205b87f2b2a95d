"""Every group of conf/ composes, and every wrong value is refused with its key and what is allowed."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from ship_trl.config.algorithm import ignored_keys, non_default_algorithm
from ship_trl.config.arm import Arm, TransferMethodName
from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import load_network
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Config, Observation, plain
from ship_trl.run.plan import make_run

HIGH = ["+pair=high", "method=finetune", "layers=3"]


def composed(*overrides: str) -> Config:
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        values = compose("config", list(overrides))
    assert isinstance(values, DictConfig)
    return to_config(values)


def options(group: str) -> list[str]:
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def test_the_main_command_is_composed() -> None:
    config = composed(*HIGH)
    assert (config.source, config.target, config.arm) == ("1", "2", Arm(TransferMethodName.finetune, 3))
    assert (config.label, config.arm_label, config.profile, config.output) == (
        "high",
        "FT3",
        "quick",
        "outputs",
    )


@pytest.mark.parametrize("pair", options("pair"))
def test_every_pair_composes(pair: str) -> None:
    config = composed(f"+pair={pair}", "layers=all")
    assert config.label == pair and config.arm_label == "FTW"
    assert make_run(config).source is not None


@pytest.mark.parametrize("case", options("case"))
def test_every_case_composes(case: str) -> None:
    config = composed(f"target={case}", "method=scratch")
    assert config.label == case and make_run(config).target.name == case


@pytest.mark.parametrize("profile", options("profile"))
def test_every_profile_composes(profile: str) -> None:
    found = OmegaConf.create(plain(composed(*HIGH, f"profile={profile}")))
    wanted = OmegaConf.load(conf_dir() / "profile" / f"{profile}.yaml")
    assert isinstance(wanted, DictConfig)
    wanted.pop("defaults", None)
    # All that the profile sets holds.
    assert OmegaConf.merge(found, wanted) == found


@pytest.mark.parametrize("network", options("network"))
def test_every_network_composes_with_each_number_of_layers(network: str) -> None:
    seen = "vector" if load_network(network).linear else "pixels"
    high = (*HIGH, f"observation={seen}", f"network={network}")
    count = composed(*high).network.depth
    for method, arm in (("finetune", "FT"), ("feature_extraction", "FE")):
        for n in range(1, count + 1):
            line = (*high, f"method={method}", f"layers={n}")
            assert composed(*line).arm_label == f"{arm}{n}"
        with pytest.raises(ConfigError, match=rf"^layers: must be 1, .*{count}.* got {count + 1}$"):
            composed(*line[:-1], f"layers={count + 1}")


def test_whole_numbers_are_accepted_as_actions() -> None:
    whole, real = (
        composed(*HIGH, f"world.actions={rows}") for rows in ("[[10,0.1],[5,0]]", "[[10.0,0.1],[5.0,0.0]]")
    )
    assert whole == real and all(type(v) is float for row in whole.world.actions for v in row)
    assert make_run(whole).config_hash == make_run(real).config_hash


@pytest.mark.parametrize("group", ["world", "algorithm", "replay", "exploration", "schedule"])
def test_every_other_group_composes(group: str) -> None:
    for name in options(group):
        teacher = ["algorithm.teacher=pretrained:4"] if name == "pupil" else []
        composed(*HIGH, f"{group}={name}", *teacher)


@pytest.mark.parametrize("launcher", options("hydra/launcher"))
def test_every_launcher_composes(launcher: str) -> None:
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        line = [*HIGH, f"hydra/launcher={launcher}"]
        chosen = compose("config", line, return_hydra_config=True).hydra.launcher
    classes = {"slurm": "SlurmLauncher", "slurm_local": "LocalLauncher"}
    assert chosen._target_.endswith(classes.get(launcher, "RayLauncher"))


def test_every_group_is_covered() -> None:
    groups = {str(path.parent.relative_to(conf_dir())) for path in conf_dir().glob("*/**/*.yaml")}
    assert groups == {
        "pair",
        "arm",
        "case",
        "suite",
        "profile",
        "world",
        "algorithm",
        "tuned",
        "picture",
        "replay",
        "exploration",
        "schedule",
        "network",
        "observation",
        "sweep",
        "hydra/launcher",
    }


@pytest.mark.parametrize("sweep", options("sweep"))
def test_every_sweep_composes(sweep: str) -> None:
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        found = compose("config", [*HIGH, f"+sweep={sweep}"], return_hydra_config=True)
    sweeper = found.hydra.sweeper
    assert sweeper._target_.endswith("OptunaSweeper") and sweeper.direction == "maximize"
    assert found.hydra.mode is RunMode.MULTIRUN
    for key in sweeper.params:
        assert OmegaConf.select(found, key) is not None, key


def test_any_two_cases_are_a_pair() -> None:
    config = composed("source=3", "target=2", "layers=1")
    assert config.label == "3-2" and config.pair is None


def test_config_survives_yaml() -> None:
    config = composed(*HIGH)
    assert to_config(OmegaConf.create(plain(config))) == config


def test_keys_that_an_algorithm_does_not_read_are_named() -> None:
    words = ["target=4", "learn.tau=0.1", "learn.gamma=0.9", "+margin.penalty=1", "learn.lr=1e-4"]
    found = {name: ignored_keys(f"ship_trl.learn.{name}:build", words) for name in ("ppo", "pupil", "n_step")}
    assert found == {"ppo": ["learn.tau"], "pupil": ["learn.gamma", "margin.penalty"], "n_step": []}


def test_an_observation_chooses_its_network_unless_another_is_given() -> None:
    assert composed(*HIGH).observation is Observation.pixels
    config = composed(*HIGH, "observation=vector")
    assert config.network == load_network("vector") and config.observation is Observation.vector
    # A group on the command line goes before the one that an observation overrides.
    for line in (("observation=vector", "network=five"), ("network=five", "observation=vector")):
        with pytest.raises(ConfigError, match="got vector"):
            composed(*HIGH, *line)
    assert composed(*HIGH, "observation=vector", "network.linear=[8,8,8]").network.depth == 3
    # Pictures of random encounters show speeds and colours.
    pixels, numbers = (
        composed("target=traffic", "method=scratch", "profile=traffic", *more)
        for more in ((), ("observation=vector",))
    )
    assert (pixels.network.vector_time, pixels.colour) == (8, True)
    assert (numbers.network, numbers.colour) == (load_network("vector"), False)


def test_a_builder_of_ones_own_takes_any_keys() -> None:
    Path("mine.py").write_text("")
    values = composed(*HIGH, "algorithm.build='mine.py:build'", "+algorithm.steps=[1,{deep: 2}]").algorithm
    assert values == {"build": "mine.py:build", "steps": [1, {"deep": 2}]}
    assert composed(*HIGH, "algorithm.build='json.decoder:build'").algorithm["build"] == "json.decoder:build"


def test_files_name_imitation_only_where_there_is_some() -> None:
    without, some = (
        composed(
            *HIGH, "algorithm=ppo", "algorithm.imitation_start=0.5", f"algorithm.imitation_coeff={value}"
        )
        for value in (0, 1)
    )
    keys = {"imitation_coeff", "imitation_start"}
    assert non_default_algorithm(without.algorithm) == {
        key: value for key, value in without.algorithm.items() if key not in keys
    }
    assert non_default_algorithm(some.algorithm) == some.algorithm and keys < set(some.algorithm)
    own = {"build": "mine.py:build", "imitation_coeff": 0}
    assert non_default_algorithm(own) == own


def test_groups_of_learn_yield_to_the_algorithm_and_that_to_profiles() -> None:
    assert composed(*HIGH, "algorithm=ppo").learn.num_envs == 16
    rates = [composed(*HIGH, f"profile={name}", "algorithm=ppo").learn.lr for name in ("paper", "quick")]
    assert rates == [2.5e-4, 1e-3]  # what conf/tuned sets wins
    assert composed(*HIGH, "algorithm=n_step").learn.lr == 5e-4
    long, ppo = (composed(*HIGH, "profile=long", *more) for more in ((), ("algorithm=ppo",)))
    assert (long.algorithm["steps"], long.learn.episodes) == (5, 1500)
    assert (ppo.algorithm["imitation_coeff"], ppo.learn.episodes) == (0.3, 5500)


def test_large_values_are_accepted() -> None:
    large = ["learn.episodes=1000000000", "learn.replay_size=20000000", "learn.batch_size=30000"]
    world = ["world.max_steps=1000", "world.dt=60", "world.goal_distance=99999", "world.reward.goal=1e6"]
    config = composed(*HIGH, *large, *world, "learn.num_envs=30000", "learn.lr=1")
    assert config.learn.episodes == 10**9 and config.world.dt == 60.0


@pytest.mark.parametrize("line", ["layers=1", "layers=2 learn.backend=dense", "layers=3 learn.backend=dense"])
def test_a_replay_of_states_may_be_large_whatever_is_frozen(line: str) -> None:
    composed("+pair=high", "method=feature_extraction", *line.split(), "learn.replay_size=1000000")
