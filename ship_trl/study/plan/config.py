"""The settings of a study: conf/study.yaml with overrides, checked before anything is written."""

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
from ship_trl.files.untrusted import read_changes, read_yaml
from ship_trl.grid.launchers import check_slurm
from ship_trl.study.plan.arms import CONTROL_ARMS, CONTROL_PAIRS, FIRST_BLOCK_ARMS, FIRST_BLOCK_PAIRS, WHOLE

# Section 4.3: the case most similar to the new one, and the pair and arm that made the reused network.
REUSED_CASE, REUSED_PAIR, REUSED_ARM, NEW_CASE = "2", "high", WHOLE, "new"
# Hydra's launchers (conf/hydra/launcher) and their plugins.
LAUNCHERS = {
    "joblib": "hydra_joblib_launcher",
    "slurm": "hydra_submitit_launcher",
    "slurm_local": "hydra_submitit_launcher",
    "ray_local": "hydra_ray_launcher",
    "ray_cluster": "hydra_ray_launcher",
}
# One seed shows no variation over seeds.
SeedCount = Annotated[int, limit(2)]
# Keys that each job sets itself.
JOB_KEYS = (
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
    """The settings; conf/study.yaml holds and explains the values."""

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
        """The number of seeds."""
        return self.profile_seeds[self.profile] if self.seeds is None else self.seeds

    @property
    def numbers(self) -> range:
        """The seeds."""
        return range(self.first_seed, self.first_seed + self.count)

    @property
    def folder(self) -> Path:
        """The study's folder."""
        return Path(self.output or f"outputs/{self.profile}_study")

    @property
    def run_overrides(self) -> list[str]:
        """The overrides of the runs, without those of Hydra and its launcher."""
        return [line for line in self.overrides if not line.startswith("hydra.")]


def to_study(overrides: list[str]) -> StudyConfig:
    """Compose conf/study.yaml with overrides and check the result.

    Raises:
        ConfigError: a key or a name is unknown, or a value is not allowed.
    """
    try:
        values = OmegaConf.merge(read_yaml(conf_dir() / "study.yaml"), read_changes(overrides))
    except (yaml.YAMLError, OmegaConfBaseException, LookupError, ValueError, TypeError, RecursionError):
        # OmegaConf raises Python's own errors for an unclosed bracket in a key, or thousands of digits.
        words, example = " ".join(overrides), "pairs=[high,low]"
        raise ConfigError(
            f"{words:.200}: cannot be read; a list is written without spaces, as {example}"
        ) from None
    config = read_as(StudyConfig, values)
    check(config)
    return config


def options(group: str) -> list[str]:
    """List the options of a config group."""
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def check(config: StudyConfig) -> None:
    """Check names, the launcher, and keys that depend on one another."""
    check_names("profile", [config.profile], options("profile"))
    check_names("pairs", config.pairs, options("pair"))
    check_names("arms", config.arms, options("arm"))
    check_names("launcher", [config.launcher], list(LAUNCHERS))
    check_logger(config.logger)
    if find_spec(f"hydra_plugins.{LAUNCHERS[config.launcher]}") is None:
        raise ConfigError(f"launcher: {missing_extra(config.launcher, config.launcher.split('_')[0])}")
    check_slurm(config.launcher, "launcher")
    if config.seeds is None and config.profile not in config.profile_seeds:
        raise ConfigError(f"seeds: must be given; conf/study.yaml has none for profile {config.profile}")
    if config.processes is not None and config.launcher != "joblib":
        raise ConfigError(f"processes: must be left out with launcher={config.launcher}, which has its own")
    if config.reuse and (REUSED_PAIR not in config.pairs or REUSED_ARM not in config.arms):
        raise ConfigError(
            f"reuse: needs pair {REUSED_PAIR} with arm {REUSED_ARM}, whose network it reuses; "
            "allowed: reuse=false"
        )
    controls = {*CONTROL_PAIRS, *FIRST_BLOCK_PAIRS, *CONTROL_ARMS, *FIRST_BLOCK_ARMS}
    for key, names in (("pairs", config.pairs), ("arms", config.arms)):
        if config.controls and (found := [name for name in names if name in controls]):
            raise ConfigError(f"{key}: {found[0]} is one of the controls; allowed: controls=false")
    check_overrides(config)


def check_overrides(config: StudyConfig) -> None:
    """Refuse keys that differ between runs: an override would give all runs the same value."""
    for key in (line.split("=")[0].lstrip("+~") for line in config.overrides):
        if key in JOB_KEYS:
            raise ConfigError(
                f"overrides: {key} differs between runs; allowed: what all runs share, as learn.lr=1e-3"
            )
        if key.startswith("perturbation"):
            raise ConfigError(
                "overrides: perturbation: a study compares with the best known returns of cases; "
                "allowed: no perturbation"
            )
        if key == "learn.epsilon_start" and config.reuse:
            raise ConfigError(f"overrides: {key} differs between runs; allowed: reuse=false")


def check_names(key: str, got: list[str], allowed: list[str]) -> None:
    """Check that there are names, that all are allowed, and that no name is repeated."""
    for name in got:
        if name not in allowed:
            raise ConfigError(f"{key}: no {name}; allowed: {', '.join(allowed)}")
    if not got or len(set(got)) < len(got):
        raise ConfigError(f"{key}: must be at least one name, each once, got {', '.join(got) or 'none'}")


@cache
def read_option(group: str, name: str) -> Mapping[str, Any]:
    """Read the values of an option of a config group."""
    values: Any = OmegaConf.to_container(read_yaml(conf_dir() / group / f"{name}.yaml"))
    return MappingProxyType(values)
