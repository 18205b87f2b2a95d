"""What a study is asked to be: conf/study.yaml with overrides, checked before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.bounds import Positive, Seed
from ship_trl.config.checks import check_logger
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import limit, read_as
from ship_trl.config.types import Logger, WandbMode
from ship_trl.run.launchers import check_slurm

# Section 4.3: the case that is most like the new one, and by which arm its network was made.
REUSED_CASE, REUSED_PAIR, REUSED_ARM, NEW_CASE = "2", "high", "FTW", "new"
# Controls, which are arms and pairs of a study that has them anyway: frozen layers without features, on
# every pair; cases to themselves; and a source with the target's ship, but not its ideal path, to set
# beside pair high, whose source has the path, but no ship (section 4.1).
RANDOM_ARM, PERMUTED_ARM, SELF_PAIR, SHIP_PAIR = "FE3-random", "FE3-permuted", "self", "ship"
LAYERED = tuple(f"{kind}{n}" for kind in ("FE", "FT") for n in range(1, 5))
CONTROL_ARMS = (RANDOM_ARM, PERMUTED_ARM)
CONTROL_PAIRS = {SELF_PAIR: LAYERED, SHIP_PAIR: ("FE3", "FTW")}
# These explore, and are run with the first block of seeds only.
EXPLORING_ARMS = tuple(f"FE{n}-{kind}" for kind in ("random", "permuted") for n in (1, 2, 4))
EXPLORING_PAIRS = {SELF_PAIR: ("FTW",), "self4": (*LAYERED, "FTW"), "self6": (*LAYERED, "FTW")}
# Hydra's launchers (conf/hydra/launcher) and the plugins that bring them.
LAUNCHERS = {
    "joblib": "hydra_joblib_launcher",
    "slurm": "hydra_submitit_launcher",
    "slurm_local": "hydra_submitit_launcher",
    "ray_local": "hydra_ray_launcher",
    "ray_cluster": "hydra_ray_launcher",
}
# Differences within a seed need two.
SeedCount = Annotated[int, limit(2)]
# What a job sets.
FIXED = (
    *("pair", "source", "target", "source_file", "source_weights", "method", "layers", "arm", "seed"),
    *("profile", "output", "case_base", "logger", "overwrite", "demonstrations", "sweep"),
)


@dataclass
class StudyWandb:
    """The wandb project of a study."""

    project: str
    mode: WandbMode
    entity: str | None


@dataclass
class StudyConfig:
    """The configuration of a study; values are in conf/study.yaml."""

    profile: str
    seeds: SeedCount | None
    first_seed: Seed
    block: Positive
    profile_seeds: dict[str, SeedCount]
    pairs: list[str]
    arms: list[str]
    reuse: bool
    controls: bool
    output: str | None
    launcher: str
    processes: Positive | None
    retries: Annotated[int, limit(0)]
    overrides: list[str]
    logger: Logger
    wandb: StudyWandb

    @property
    def count(self) -> int:
        """How many seeds."""
        return self.profile_seeds[self.profile] if self.seeds is None else self.seeds

    @property
    def numbers(self) -> range:
        """The seeds."""
        return range(self.first_seed, self.first_seed + self.count)

    @property
    def folder(self) -> Path:
        """Where everything lies."""
        return Path(self.output or f"outputs/{self.profile}_study")

    @property
    def of_runs(self) -> list[str]:
        """Overrides that are of the runs; the others are of Hydra and its launcher."""
        return [line for line in self.overrides if not line.startswith("hydra.")]


def to_study(overrides: list[str]) -> StudyConfig:
    """Compose conf/study.yaml with overrides and check it.

    Raises:
        ConfigError: an unknown key, a wrong value, an unknown name.
    """
    try:
        values = OmegaConf.merge(OmegaConf.load(conf_dir() / "study.yaml"), OmegaConf.from_dotlist(overrides))
    except (yaml.YAMLError, OmegaConfBaseException, LookupError, ValueError, TypeError, RecursionError):
        # OmegaConf raises Python's own errors for an unclosed bracket in a key, or thousands of digits.
        raise ConfigError(
            f"{' '.join(overrides)}: cannot be read; a list is written without spaces, as pairs=[high,low]"
        ) from None
    config = read_as(StudyConfig, values)
    check(config)
    return config


def names(group: str) -> list[str]:
    """List what a config group offers."""
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def check(config: StudyConfig) -> None:
    """Check names, the launcher, and what several keys say together."""
    one_of("profile", [config.profile], names("profile"))
    one_of("pairs", config.pairs, names("pair"))
    one_of("arms", config.arms, names("arm"))
    one_of("launcher", [config.launcher], list(LAUNCHERS))
    check_logger(config.logger)
    plugin = LAUNCHERS[config.launcher]
    if find_spec(f"hydra_plugins.{plugin}") is None:
        extra = config.launcher.split("_")[0]
        raise ConfigError(f"launcher: {missing_extra(config.launcher, extra)}")
    check_slurm(config.launcher, "launcher")
    check_overrides(config)
    if config.seeds is None and config.profile not in config.profile_seeds:
        raise ConfigError(f"seeds: must be given, for conf/study.yaml has none for profile {config.profile}")
    control_names = {*CONTROL_PAIRS, *EXPLORING_PAIRS, *CONTROL_ARMS, *EXPLORING_ARMS}
    for key in ("pairs", "arms"):
        for name in getattr(config, key):
            if config.controls and name in control_names:
                raise ConfigError(f"{key}: {name} is one of the controls; allowed: controls=false")
    if config.processes is not None and config.launcher != "joblib":
        raise ConfigError(f"processes: must be left out with launcher={config.launcher}, which has its own")
    if config.reuse and (REUSED_PAIR not in config.pairs or REUSED_ARM not in config.arms):
        raise ConfigError(
            f"reuse: needs pair {REUSED_PAIR} with arm {REUSED_ARM}, whose network it reuses; "
            "allowed: reuse=false"
        )


def check_overrides(config: StudyConfig) -> None:
    """Check that the overrides leave alone what tells the study's runs apart."""
    fixed = {*FIXED, *(["learn.epsilon_start"] if config.reuse else [])}
    for line in config.overrides:
        key = line.split("=")[0].lstrip("+~")
        if key in fixed:
            allowed = "what all may share, as learn.lr=1e-3"
            if key == "learn.epsilon_start":
                allowed = "reuse=false"
            raise ConfigError(f"overrides: {key} tells the study's runs apart; allowed: {allowed}")


def one_of(key: str, got: list[str], allowed: list[str]) -> None:
    """Check that all names are allowed, and none is there twice."""
    for name in got:
        if name not in allowed:
            raise ConfigError(f"{key}: no {name}; allowed: {', '.join(allowed)}")
    if not got or len(set(got)) < len(got):
        raise ConfigError(f"{key}: each at most once and at least one, got {', '.join(got) or 'none'}")


@cache
def read(group: str, name: str) -> Mapping[str, Any]:
    """Read the values of a config group's choice; a plan asks for the same few again and again."""
    values: Any = OmegaConf.to_container(OmegaConf.load(conf_dir() / group / f"{name}.yaml"))
    return MappingProxyType(values)
