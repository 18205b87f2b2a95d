"""The keys of each bundled algorithm, and the check of the function that builds one. No torch."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from ship_trl.config.bounds import MAX_STEPS, Count, PositiveShare, Share
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import is_path
from ship_trl.config.schema import read_as, rule
from ship_trl.config.types import Learn

DEFAULT = {"build": "ship_trl.learn.double_dqn:build"}
ALLOWED = "module:function or file.py:function"
TEACHERS = "a safetensors file, a result folder, or pretrained:NAME"
TeacherName = Annotated[Any, rule(TEACHERS, lambda name: isinstance(name, str) and is_path(name))]
# Steps of each environment that are held in memory; pictures that are computed at once.
MAX_ROLLOUT_STEPS, MAX_MINIBATCH = 100_000, 10_000
# Steps of all environments in a rollout; with eight target ships they take 4 GB.
MAX_ROLLOUT = 10_000_000


@dataclass
class DoubleDQN:
    """Double dueling DQN has no keys of its own; all are in `learn`."""


@dataclass
class NStep:
    """Double dueling DQN with targets of `steps` rewards."""

    steps: Annotated[int, Field(ge=1, le=MAX_STEPS)]


@dataclass
class PPO:
    """Proximal policy optimisation.

    An update makes `epochs` passes over `rollout_steps` steps of each of `learn.num_envs` environments. After
    `imitation_start`, a share of the episodes, it also imitates the best episode from each start.
    """

    rollout_steps: Annotated[int, Field(ge=2, le=MAX_ROLLOUT_STEPS)]
    epochs: Count
    minibatch_size: Annotated[int, Field(ge=1, le=MAX_MINIBATCH)]
    clip_epsilon: Annotated[float, Field(gt=0, le=1)]
    gae_lambda: Share
    entropy_coeff: Annotated[float, Field(ge=0, le=1)]
    critic_coeff: Annotated[float, Field(ge=0, le=1000)]
    max_grad_norm: Annotated[float, Field(gt=0)]
    imitation_coeff: Annotated[float, Field(ge=0, le=1000)]
    imitation_start: Share


@dataclass
class Pupil:
    """Distillation of the network of a `teacher` (learn/pupil.py).

    `own_fraction` is the share of the episodes after which the pupil chooses all actions. The temperature is
    in scaled rewards.
    """

    teacher: TeacherName
    own_fraction: PositiveShare
    temperature: Annotated[float, Field(gt=0)]
    huber_weight: Annotated[float, Field(ge=0, le=1000)]


# The keys of each bundled algorithm beside `build`; a builder of one's own takes any.
SETTINGS: dict[str, type] = {
    DEFAULT["build"]: DoubleDQN,
    "ship_trl.learn.n_step:build": NStep,
    "ship_trl.learn.ppo:build": PPO,
    "ship_trl.learn.pupil:build": Pupil,
}
# Those that learn from their own actions alone.
ON_POLICY = ("ship_trl.learn.ppo:build",)
# Those that learn the Q-values of a teacher.
DISTILS = ("ship_trl.learn.pupil:build",)
# PPO's keys of imitation.
IMITATION = ("imitation_coeff", "imitation_start")
# Keys that they do not read.
REPLAY_KEYS = ("batch_size", "update_every", "tau", "loss", "huber_delta", "replay_size", "warmup_steps")
EPSILON_KEYS = ("epsilon_start", "epsilon_end", "epsilon_fraction")
IGNORED = {
    "ship_trl.learn.ppo:build": tuple(f"learn.{key}" for key in REPLAY_KEYS + EPSILON_KEYS),
    "ship_trl.learn.pupil:build": ("learn.loss", "learn.gamma", "margin.distance", "margin.penalty"),
}


def is_installed(package: str) -> bool:
    """Return whether a package can be found; it is not imported."""
    try:
        return importlib.util.find_spec(package) is not None
    except ValueError:  # a module without a spec, as `__main__`
        return False


def read_algorithm(values: dict[str, Any], learn: Learn) -> dict[str, Any]:
    """Check `build` and the keys of a bundled algorithm; return them with their types.

    Raises:
        ConfigError: `build` names no function, its file or package is missing, or a key is unknown or wrong.
    """
    options = dict(values)
    build = options.pop("build", None)
    where, _, function = build.rpartition(":") if isinstance(build, str) else ("", "", "")
    is_file, package = where.endswith(".py"), where.split(".")[0]
    if not function.isidentifier() or not (is_file or all(map(str.isidentifier, where.split(".")))):
        raise ConfigError(f"algorithm.build: must be {ALLOWED}, got {build}")
    if is_file and not (is_path(where) and Path(where).is_file()):
        raise ConfigError(f"algorithm.build: no file {where}; allowed: {ALLOWED}")
    if not is_file and not is_installed(package):
        raise ConfigError(f"algorithm.build: no module {package}; allowed: {ALLOWED}")
    if (schema := SETTINGS.get(build)) is None:
        return values
    settings: Any = read_as(schema, options, key="algorithm")
    if isinstance(settings, PPO):
        most = settings.rollout_steps * learn.num_envs
        if most > MAX_ROLLOUT:
            raise ConfigError(
                f"algorithm.rollout_steps: must be at most {MAX_ROLLOUT // learn.num_envs} (with "
                f"learn.num_envs={learn.num_envs} environments), got {settings.rollout_steps}"
            )
        if settings.minibatch_size > most:
            raise ConfigError(
                f"algorithm.minibatch_size: must be at most {most} (rollout_steps of learn.num_envs="
                f"{learn.num_envs} environments), got {settings.minibatch_size}"
            )
    return {"build": build, **dataclasses.asdict(settings)}


def ignored_keys(build: str, words: Iterable[str]) -> list[str]:
    """Return the keys of a command line that an algorithm does not read."""
    keys = (word.partition("=")[0].lstrip("+") for word in words)
    return [key for key in keys if key in IGNORED.get(build, ())]


def non_default_algorithm(algorithm: dict[str, Any]) -> dict[str, Any] | None:
    """Return the values of `algorithm` that files and digests hold; None for the paper's.

    Without imitation PPO's two keys of it are left out, so that older results keep their digest.
    """
    if algorithm == DEFAULT:
        return None
    if algorithm["build"] in ON_POLICY and not algorithm["imitation_coeff"]:
        return {key: value for key, value in algorithm.items() if key not in IMITATION}
    return algorithm
