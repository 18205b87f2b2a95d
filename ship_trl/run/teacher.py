"""The teacher of a run: the network that `algorithm.teacher` names. No torch until it is read."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from ship_trl.config.algorithm import TEACHERS
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config
from ship_trl.policies.pretrained import find, is_pretrained
from ship_trl.transfer.casebase import POLICY

if TYPE_CHECKING:
    from ship_trl.learn.algorithm import Teacher
    from ship_trl.sim.env import ShipEnv

KEY = "algorithm.teacher"


def find_teacher(config: Config) -> Path | None:
    """Return the teacher's file, or None for an algorithm without a teacher.

    Raises:
        ConfigError: there is no such file.
    """
    if (name := config.algorithm.get("teacher")) is None:
        return None
    if is_pretrained(str(name)):
        return find(str(name), None, KEY).file
    path = Path(str(name))
    path = path / POLICY if path.is_dir() else path
    if not path.is_file():
        raise ConfigError(f"{KEY}: no file {path}; allowed: {TEACHERS}")
    return path


def digest_teacher(config: Config) -> str | None:
    """Return the SHA-256 of the teacher's file; None without a teacher.

    Raises:
        ConfigError: see `find_teacher`.
    """
    path = find_teacher(config)
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def describe_teacher(config: Config) -> str | None:
    """Return the teacher's name and digest for a result; None without a teacher."""
    digest = digest_teacher(config)
    return None if digest is None else f"{config.algorithm['teacher']} sha256={digest}"


def read_teacher(config: Config, env: ShipEnv) -> Teacher | None:
    """Return the Q-values of the teacher as a function of states; None without a teacher.

    Raises:
        ConfigError: the file is invalid, or its network has other actions or colours.
    """
    if (path := find_teacher(config)) is None:
        return None
    from ship_trl.policies.named import load_network

    network = load_network(path, env, KEY)
    observe = env.observer(network.config)
    return lambda state: network(observe(state))
