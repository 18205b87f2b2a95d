"""Types and checks of the configuration; the values are the YAML files in conf/. No torch here.

Every complaint is a `ConfigError` whose one line names the key and what is allowed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException, ValidationError

CONV_LAYERS = 4


class ConfigError(Exception):
    """Wrong input; its text is one line for the user."""


class Method(str, Enum):
    """How the source's layers are used (section 3.5)."""

    scratch = "scratch"
    feature_extraction = "feature_extraction"
    finetune = "finetune"


Loss = Enum("Loss", ["l2", "smooth_l1"])
Logger = Enum("Logger", ["csv", "wandb"])
WandbMode = Enum("WandbMode", ["offline", "online"])
ARM_PREFIX = {Method.feature_extraction: "FE", Method.finetune: "FT"}


@dataclass
class Reward:
    """Constants of equations 4 to 6."""

    goal: float
    collision: float
    w1: float
    w2: float
    w3: float
    w4: float
    k1: float
    k2: float


@dataclass
class World:
    """The physics shared by all cases (sections 3.1 and 3.3)."""

    dt: float
    max_steps: int
    safe_distance: float
    goal_distance: float
    actions: list[list[float]]
    reward: Reward


@dataclass
class Learn:
    """The double dueling DQN and its schedule (section 3.2)."""

    episodes: int
    num_envs: int
    gamma: float
    lr: float
    batch_size: int
    replay_size: int
    warmup_steps: int
    update_every: int
    tau: float
    loss: Loss
    reward_scale: float
    epsilon_start: float
    epsilon_end: float
    epsilon_fraction: float
    evaluate_every: int


@dataclass
class Wandb:
    """Where a wandb run goes; offline needs no account."""

    project: str
    mode: WandbMode
    entity: str | None


@dataclass
class Config:
    """One run: an arm on a pair of cases with a seed."""

    pair: str | None
    source: str | None
    target: str | None
    source_file: str | None
    method: Method
    layers: Any
    seed: int
    device: str
    colour: bool
    logger: Logger
    output: str
    case_base: str
    overwrite: bool
    profile: str
    world: World
    learn: Learn
    wandb: Wandb

    @property
    def arm(self) -> str:
        """The curve's name in the paper's figures: scratch, FE1-4, FT1-4 or FTW."""
        if self.method is Method.scratch:
            return "scratch"
        return ARM_PREFIX[self.method] + ("W" if self.layers == "all" else str(self.layers))

    @property
    def label(self) -> str:
        """Name of the pair: as shipped, else `source-target`, else the target case alone."""
        if self.pair:
            return self.pair
        return str(self.target) if self.source is None else f"{self.source}-{self.target}"


def to_config(values: DictConfig) -> Config:
    """Check composed values against the types and return them as a `Config`.

    Merging into the typed schema once more is what catches a typo behind `+`, which Hydra alone
    lets pass.

    Raises:
        ConfigError: an unknown or missing key, a wrong type, or a value out of range.
    """
    try:
        merged = OmegaConf.merge(OmegaConf.structured(Config), values)
        config: Any = OmegaConf.to_object(merged)
    except OmegaConfBaseException as error:
        raise ConfigError(explain(error)) from None
    check(config)
    return config


def explain(error: OmegaConfBaseException) -> str:
    """One line for an OmegaConf error: the full key, then what is allowed there."""
    key = error.full_key or str(error.key or "config")
    lines = str(error.msg or error).strip().splitlines() or [type(error).__name__]
    fields = dataclasses.fields(error.object_type) if dataclasses.is_dataclass(error.object_type) else ()
    if isinstance(error, ConfigKeyError) and fields:
        return f"{key}: unknown key; allowed here: {', '.join(f.name for f in fields)}"
    if isinstance(error, ValidationError):
        return f"{key}: {lines[0]}"
    return f"{key}: {lines[0].replace('Structured config of type `Config` has missing mandatory value', 'missing')}"


def require(condition: bool, key: str, allowed: str, got: object) -> None:
    """Raise a `ConfigError` naming `key`, what is `allowed` and what was given."""
    if not condition:
        raise ConfigError(f"{key}: must be {allowed}, got {got}")


def at_least(least: float, keys: dict[str, float]) -> None:
    """Check that every named number is finite and not below `least`."""
    for key, value in keys.items():
        require(math.isfinite(value) and value >= least, key, f"at least {least}", value)


def positive(keys: dict[str, float]) -> None:
    """Check that every named number is finite and above 0."""
    for key, value in keys.items():
        require(math.isfinite(value) and value > 0, key, "above 0", value)


def within(keys: dict[str, float]) -> None:
    """Check that every named number lies in [0, 1]."""
    for key, value in keys.items():
        require(0.0 <= value <= 1.0, key, "from 0 to 1", value)


def named(prefix: str, values: object, fields: str) -> dict[str, float]:
    """The fields of a dataclass under their full keys."""
    return {f"{prefix}.{name}": getattr(values, name) for name in fields.split()}


def check(config: Config) -> None:
    """Check ranges and what the keys say together (cases are checked where they are loaded)."""
    learn, world = config.learn, config.world
    counts = "episodes num_envs batch_size replay_size update_every evaluate_every"
    at_least(1, named("learn", learn, counts))
    at_least(0, named("learn", learn, "warmup_steps") | {"seed": config.seed})
    positive(named("learn", learn, "lr reward_scale"))
    within(named("learn", learn, "gamma tau epsilon_start epsilon_end epsilon_fraction"))
    positive(named("learn", learn, "tau epsilon_fraction"))
    require(
        learn.batch_size <= learn.replay_size,
        "learn.batch_size",
        f"at most learn.replay_size={learn.replay_size}",
        learn.batch_size,
    )
    positive(named("world", world, "dt max_steps safe_distance goal_distance"))
    finite(f"world.reward.{f.name}" for f in dataclasses.fields(Reward))(world.reward)
    require(
        bool(world.actions) and all(len(a) == 2 and all(map(math.isfinite, a)) for a in world.actions),
        "world.actions",
        "a list of [v in m/s, omega in rad/s]",
        world.actions,
    )
    require(
        config.device == "cpu" or config.device.split(":")[0] == "cuda",
        "device",
        "cpu or cuda",
        config.device,
    )
    check_arm(config)


def finite(keys: Iterable[str]) -> Any:
    """A check that the fields behind the full `keys` are finite numbers."""
    names = list(keys)

    def run(values: object) -> None:
        for key in names:
            value = getattr(values, key.rsplit(".", 1)[1])
            require(math.isfinite(value), key, "a finite number", value)

    return run


def check_arm(config: Config) -> None:
    """Check method, layers, source and target against one another."""
    layers = config.layers
    if config.target is None:
        raise ConfigError(
            "pair: none given; give +pair=NAME (see --help for the names), "
            "or source=CASE target=CASE, or method=scratch target=CASE"
        )
    if config.method is Method.scratch:
        require(layers is None, "layers", "left out with method=scratch", layers)
        require(config.source_file is None, "source_file", "left out with method=scratch", config.source_file)
        return
    require(config.source is not None, "source", f"a case, for method={config.method.value}", "none")
    numbers = "1, 2, 3, 4" if config.method is Method.feature_extraction else "1, 2, 3, 4 or all"
    known = type(layers) is int and 1 <= layers <= CONV_LAYERS
    whole = layers == "all" and config.method is Method.finetune
    require(known or whole, "layers", f"{numbers} with method={config.method.value}", layers)
