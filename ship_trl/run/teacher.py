"""The teacher of a run: the network that `algorithm.teacher` names. No torch until it is read."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from omegaconf import OmegaConf

from ship_trl.config.algorithm import TEACHERS
from ship_trl.config.bounds import RewardScale
from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import read_as
from ship_trl.config.types import Config, plain
from ship_trl.files.untrusted import read_yaml
from ship_trl.policies.pretrained import PRETRAINED, REWARD_SCALE, find, is_pretrained
from ship_trl.run.folder import flatten, read_settings
from ship_trl.transfer.casebase import CONFIG, POLICY, POLICY_LAST

if TYPE_CHECKING:
    from ship_trl.learn.algorithm import Teacher
    from ship_trl.sim.env import ShipEnv

KEY = "algorithm.teacher"


def find_teacher(config: Config) -> Path | None:
    """Return the teacher's file, or None for an algorithm without a teacher.

    Raises:
        ConfigError: there is no such file, or it is in a result folder of another world.
    """
    if (name := config.algorithm.get("teacher")) is None:
        return None
    if is_pretrained(str(name)) and name != PRETRAINED:
        return find(str(name), None, KEY).file
    path = Path(str(name))
    path = path / POLICY if path.is_dir() else path
    if not path.is_file():
        raise ConfigError(f"{KEY}: no file {path}; allowed: {TEACHERS}")
    if (known := teacher_config(config)) is not None:
        ours = dict(flatten(plain(config.world), "world"))
        there = flatten(plain(read_settings(known.parent)[0]), "world")
        if others := [f"{key}={value}" for key, value in there if ours[key] != value]:
            raise ConfigError(
                f"{KEY}: {known.parent} is of another world: {others[0]}; allowed: the same world"
            )
    return path


def teacher_config(config: Config) -> Path | None:
    """Return the configuration that a teacher was trained with; None where it is unknown.

    It is in the result folder. A file of another name may lie beside any other config.yaml.
    """
    path = Path(str(config.algorithm.get("teacher")))
    path = (path.parent if path.name in (POLICY, POLICY_LAST) else path) / CONFIG
    return path if path.is_file() else None


def teacher_factor(config: Config) -> float:
    """Return the factor from the teacher's scaled rewards to the run's; 1 where the teacher's are unknown.

    Raises:
        ConfigError: the teacher's configuration is invalid.
    """
    if is_pretrained(str(config.algorithm.get("teacher"))):
        return config.learn.reward_scale / REWARD_SCALE
    if (path := teacher_config(config)) is None:
        return 1.0
    key = "learn.reward_scale"
    scale = read_as(RewardScale, OmegaConf.select(read_yaml(path), key), f"{KEY}: {path}: ", key=key)
    return config.learn.reward_scale / scale


def digest_teacher(config: Config) -> str | None:
    """Return the SHA-256 of the teacher's file; None without a teacher.

    Raises:
        ConfigError: see `find_teacher`.
    """
    path = find_teacher(config)
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def read_teacher(config: Config, env: ShipEnv) -> Teacher | None:
    """Return the teacher's Q-values in the run's scaled rewards, of states; None without a teacher.

    Raises:
        ConfigError: the file is invalid, or its network has other actions.
    """
    if (path := find_teacher(config)) is None:
        return None
    from ship_trl.policies.named import load_network

    network = load_network(path, env, KEY)
    observe = env.observer(network.config, network.colour)
    factor = teacher_factor(config)
    return lambda state: factor * network(observe(state))
