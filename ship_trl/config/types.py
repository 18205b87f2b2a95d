"""The types of the configuration; the values are the YAML files in conf/, the checks in checks.py."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from ship_trl.config.arm import Arm, Method, SourceWeights
from ship_trl.config.errors import ConfigError

# Pixels a side of what the network sees.
PICTURE = 84
# An environment variable, `on` or `off`: whether learn.precision=auto may choose bf16.
BFLOAT16 = "SHIP_TRL_BFLOAT16"


class Logger(Enum):
    """Where a run's numbers go beside `curve.csv`, which is always written."""

    csv = "csv"
    wandb = "wandb"
    tensorboard = "tensorboard"
    all = "all"

    def includes(self, other: Logger) -> bool:
        """Whether the numbers go to `other`, which `all` includes."""
        return self in (other, Logger.all)


class Objective(Enum):
    """What of a run a sweeper maximises: a greedy return.

    `late` is the mean of the evaluations after exploration, `final` the last one, `best` the highest.
    """

    late = "late"
    final = "final"
    best = "best"


Loss = Enum("Loss", ["l2", "huber"])
WandbMode = Enum("WandbMode", ["offline", "online"])


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


class Precision(Enum):
    """In what the conv layers compute; `auto` is bf16 where the processor multiplies it natively."""

    auto = "auto"
    fp32 = "fp32"
    bf16 = "bf16"


class BackendName(Enum):
    """What computes the conv layers: whole pictures, or on a CPU what differs from the background."""

    auto = "auto"
    incremental = "incremental"
    dense = "dense"


def bfloat16_allowed() -> bool:
    """Read `SHIP_TRL_BFLOAT16`: `off` makes any machine one that does not multiply bfloat16.

    Raises:
        ConfigError: it is neither `on` nor `off`.
    """
    value = os.environ.get(BFLOAT16) or "on"
    if value not in ("on", "off"):
        raise ConfigError(f"{BFLOAT16}: must be on or off, got {value}")
    return value == "on"


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
class Network:
    """The layers of the network (section 3.5).

    `conv` are its conv layers from the picture on, each [filters, kernel, stride], square and without
    padding; `hidden` is the width of the fully connected layer that value and advantage share.
    """

    conv: list[list[int]]
    hidden: int


@dataclass
class Learn:
    """The double dueling DQN and its schedule (section 3.2)."""

    episodes: int
    num_envs: int
    gamma: float
    lr: float
    lr_end: float
    batch_size: int
    replay_size: int
    warmup_steps: int
    update_every: int
    tau: float
    loss: Loss
    huber_delta: float
    precision: Precision
    backend: BackendName
    reward_scale: float
    epsilon_start: float
    epsilon_end: float
    epsilon_fraction: float
    evaluate_every: int
    jumpstart_draws: int


@dataclass
class Checkpoint:
    """How often a training is written down, so that it can go on after it was stopped.

    `every` is a share of the episodes, `seconds` the least time between two; 0 and 0: after each episode.
    """

    every: float
    seconds: float


@dataclass
class Wandb:
    """Where a wandb run goes; offline needs no account.

    `folder` holds `wandb/offline-run-*`; `group` is the pair where it is None.
    """

    project: str
    mode: WandbMode
    entity: str | None
    folder: str
    group: str | None


@dataclass
class Config:
    """One run: an arm on a pair of cases with a seed."""

    pair: str | None
    source: str | None
    target: str | None
    source_file: str | None
    source_weights: SourceWeights
    demonstrations: str | None
    method: Method
    layers: Any
    seed: int
    device: str
    colour: bool
    logger: Logger
    objective: Objective
    output: str
    case_base: str
    overwrite: bool
    profile: str
    world: World
    network: Network
    learn: Learn
    checkpoint: Checkpoint
    wandb: Wandb

    @property
    def arm(self) -> Arm:
        """The arm of a checked configuration."""
        return Arm(self.method, self.layers, self.source_weights)

    @property
    def arm_label(self) -> str:
        """Name of the arm in folders and results, which says so if the run begins with demonstrations."""
        return self.arm.label(demonstrations=self.demonstrations is not None)

    def with_arm(self, arm: Arm) -> Config:
        """Return the configuration with another arm; one from scratch has no source either."""
        changes: dict[str, Any] = {"method": arm.method, "layers": arm.layers, "source_weights": arm.weights}
        if arm.is_scratch:
            changes |= {"source": None, "source_file": None}
        return dataclasses.replace(self, **changes)

    @property
    def label(self) -> str:
        """Name of the pair: as shipped, else `source-target`, else the target case alone."""
        target = Path(str(self.target)).stem
        if self.pair:
            return self.pair
        return target if self.source is None else f"{Path(self.source).stem}-{target}"


def plain(values: Any) -> Any:
    """Return a config object as plain dicts, lists and words, for JSON, YAML and wandb."""
    return OmegaConf.to_container(OmegaConf.structured(values), enum_to_str=True)
