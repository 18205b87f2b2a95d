"""The types of the configuration; the values are the YAML files in conf/.

What several keys must fulfil together is in checks.py.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

from omegaconf import OmegaConf

from ship_trl.config.arm import Arm, Method, SourceWeights
from ship_trl.config.bounds import (
    MAX_COUNT,
    MAX_DRAWS,
    MAX_HUBER_DELTA,
    MAX_REWARD_SCALE,
    MAX_STEP_SECONDS,
    MAX_STEPS,
    MAX_UNITS,
    MIN_STEP_SECONDS,
    Actions,
    Coefficient,
    ConvNumbers,
    Count,
    Device,
    FolderName,
    LearningRate,
    Metres,
    PathName,
    Positive,
    PositiveShare,
    Seed,
    Share,
)
from ship_trl.config.errors import ConfigError
from ship_trl.config.schema import Rule, limit

# Pixels a side of what the network sees.
PICTURE = 84
# An environment variable, `on` or `off`: whether learn.precision=auto may choose bf16.
BFLOAT16 = "SHIP_TRL_BFLOAT16"


class Logger(Enum):
    """Where a run's numbers go besides `curve.csv`, which is always written."""

    csv = "csv"
    wandb = "wandb"
    tensorboard = "tensorboard"
    all = "all"

    def includes(self, other: Logger) -> bool:
        """Return whether the numbers go to `other`, which `all` includes."""
        return self in (other, Logger.all)


class Objective(Enum):
    """The greedy return of a run that a sweeper maximises.

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

    goal: Coefficient
    collision: Coefficient
    w1: Coefficient
    w2: Coefficient
    w3: Coefficient
    w4: Coefficient
    k1: Coefficient
    k2: Coefficient


class Precision(Enum):
    """The number format of the conv layers; `auto` is bf16 where the processor multiplies it natively."""

    auto = "auto"
    fp32 = "fp32"
    bf16 = "bf16"


class BackendName(Enum):
    """How conv layers are computed: whole pictures, or on a CPU only what differs from a background."""

    auto = "auto"
    incremental = "incremental"
    dense = "dense"


def bfloat16_allowed() -> bool:
    """Return whether `SHIP_TRL_BFLOAT16` allows bfloat16; `off` forbids it on any machine.

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

    dt: Annotated[float, limit(MIN_STEP_SECONDS, MAX_STEP_SECONDS, note="seconds")]
    max_steps: Annotated[int, limit(1, MAX_STEPS, note="the planner's memory grows with its square")]
    safe_distance: Metres
    goal_distance: Metres
    actions: Actions
    reward: Reward


@dataclass
class Network:
    """The layers of the network (section 3.5).

    `conv` are its conv layers from the picture on, each [filters, kernel, stride], square and without
    padding; `hidden` is the width of the fully connected layer that value and advantage share.
    """

    conv: Annotated[list[ConvNumbers], Rule("at least one [filters, kernel, stride]", bool)]
    hidden: Annotated[int, limit(1, MAX_UNITS)]


@dataclass
class Learn:
    """The double dueling DQN and its schedule (section 3.2)."""

    episodes: Count
    num_envs: Positive
    gamma: Share
    lr: LearningRate
    lr_end: LearningRate
    batch_size: Positive
    replay_size: Positive
    warmup_steps: Annotated[int, limit(0, MAX_COUNT)]
    update_every: Count
    tau: PositiveShare
    loss: Loss
    huber_delta: Annotated[float, limit(above=0, high=MAX_HUBER_DELTA)]
    precision: Precision
    backend: BackendName
    reward_scale: Annotated[float, limit(above=0, high=MAX_REWARD_SCALE)]
    epsilon_start: Share
    epsilon_end: Share
    epsilon_fraction: PositiveShare
    evaluate_every: Count
    jumpstart_draws: Annotated[int, limit(0, MAX_DRAWS)]


@dataclass
class Checkpoint:
    """How often a checkpoint is written, from which a stopped run goes on.

    `every` is a share of the episodes, `seconds` the least time between two; 0 and 0: after each episode.
    """

    every: Share
    seconds: Annotated[float, limit(0)]


@dataclass
class Wandb:
    """Where a wandb run goes; offline needs no account.

    `folder` holds `wandb/offline-run-*`; a `group` of None stands for the pair.
    """

    project: str
    mode: WandbMode
    entity: str | None
    folder: PathName
    group: str | None


@dataclass
class Config:
    """One run: an arm on a pair of cases with a seed."""

    pair: FolderName | None
    source: PathName | None
    target: PathName | None
    source_file: PathName | None
    source_weights: SourceWeights
    demonstrations: PathName | None
    method: Method
    layers: Any
    seed: Seed
    device: Device
    colour: bool
    logger: Logger
    objective: Objective
    output: PathName
    case_base: PathName
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
    """Return a config object as dicts, lists and single values, for JSON, YAML and wandb."""
    return OmegaConf.to_container(OmegaConf.structured(values), enum_to_str=True)
