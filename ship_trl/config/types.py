"""The types of the configuration; the values are the YAML files in conf/.

Bounds of single values are in bounds.py, rules of several keys are in checks.py.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

from omegaconf import OmegaConf
from pydantic import Field

from ship_trl.config import bounds
from ship_trl.config.arm import DEMONSTRATED, Arm, MethodName, SourceWeights, forms
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import module_names, stem
from ship_trl.config.schema import rule

# Environment variable, `on` or `off`: whether learn.precision=auto may choose bf16.
BFLOAT16 = "SHIP_TRL_BFLOAT16"


# A run is logged to the trackers of these names, a file each; `all` is all of them.
TRACKERS = module_names("run/trackers")
LOGGERS = *TRACKERS, "all"
Logger = Annotated[str, rule(f"one of {', '.join(LOGGERS)}", LOGGERS.__contains__)]


def trackers_of(logger: str) -> list[str]:
    """List the trackers that `logger` names: CSV always, and no wandb where `WANDB_MODE` disables it."""
    others = [name for name in TRACKERS if name != "csv" and logger in (name, "all")]
    is_disabled = os.environ.get("WANDB_MODE") == "disabled"
    return ["csv", *(name for name in others if name != "wandb" or not is_disabled)]


Loss = StrEnum("Loss", ["l2", "huber"])
# What the rules ask of own ship towards a target ship: keep clear of it, or hold its course.
EncounterClass = StrEnum("EncounterClass", ["head_on", "give_way", "stand_on", "overtaking", "overtaken"])
# What the network sees: pictures, or the scene as numbers in own ship's frame.
Observation = StrEnum("Observation", ["pixels", "vector"])
# What a sweeper maximises: the mean greedy return after exploration, the last one, or the highest.
Objective = StrEnum("Objective", ["late", "final", "best"])
# The number format of the conv layers; `auto` is bf16 where the processor multiplies it natively.
Precision = StrEnum("Precision", ["auto", "fp32", "bf16"])
# How conv layers are computed: on whole pictures, or on a CPU only where they differ from a background.
BackendName = StrEnum("BackendName", ["auto", "incremental", "dense"])
WandbMode = StrEnum("WandbMode", ["offline", "online"])


def bfloat16_allowed() -> bool:
    """Return whether `SHIP_TRL_BFLOAT16` allows bfloat16; `off` forbids it on any machine."""
    value = os.environ.get(BFLOAT16) or "on"
    if value not in ("on", "off"):
        raise ConfigError(f"{BFLOAT16}: must be on or off, got {value}")
    return value == "on"


@dataclass
class Reward:
    """Constants of equations 4 to 6."""

    goal: bounds.Bonus
    collision: bounds.Penalty
    w1: bounds.Coefficient
    w2: bounds.Coefficient
    w3: bounds.Coefficient
    w4: bounds.Coefficient
    k1: bounds.Coefficient
    k2: bounds.Coefficient


@dataclass(frozen=True)
class GiveWay:
    """When and how sharply a target ship gives way, if that is its behaviour (`sim.transition.give_way`).

    It gives way to own ship if they would pass at less than `dcpa` metres in at most `tcpa` seconds, and
    turns at `turn` rad/s.
    """

    tcpa: bounds.Seconds = 30.0
    dcpa: bounds.Bound = 90.0
    turn: Annotated[float, Field(ge=0, le=1)] = 0.1


@dataclass
class World:
    """The physics shared by all cases (sections 3.1 and 3.3); the defaults are the paper's.

    `turn_time` and `speed_time` are the time constants with which own ship's yaw rate and speed follow an
    action; 0 is at once.
    """

    dt: Annotated[float, Field(ge=bounds.MIN_STEP_SECONDS, le=bounds.MAX_STEP_SECONDS)]
    max_steps: Annotated[int, Field(ge=1, le=bounds.MAX_STEPS)]
    safe_distance: bounds.Metres
    goal_distance: bounds.Metres
    actions: bounds.Actions
    reward: Reward
    turn_time: bounds.Seconds = 0.0
    speed_time: bounds.Seconds = 0.0
    give_way: GiveWay = GiveWay()

    @property
    def straight_action(self) -> int:
        """Index of the action that turns least; of several, the fastest."""
        return min(range(len(self.actions)), key=lambda k: (abs(self.actions[k][1]), -self.actions[k][0]))


# Which ship of an encounter in AIS traffic is own ship.
OwnShip = StrEnum("OwnShip", ["gives_way", "stands_on", "both"])
Targets = StrEnum("Targets", ["straight", "replay"])


@dataclass(frozen=True)
class Perturbation:
    """Bounds of uniform random changes of a case's start, to either side.

    `own_position` (m) moves own ship along x and y, `own_heading` (degrees) turns it; `ship_position` (m) and
    `ship_speed` (m/s) change each target ship, whose speed stays at least zero.
    """

    own_position: bounds.Bound = 0.0
    own_heading: Annotated[float, Field(ge=0, le=180)] = 0.0
    ship_position: bounds.Bound = 0.0
    ship_speed: bounds.Bound = 0.0

    @property
    def is_none(self) -> bool:
        """Whether nothing is changed."""
        return self == Perturbation()


@dataclass(frozen=True)
class Situations:
    """How encounters of other tools become cases (ship_trl.formats).

    `safe` is the real distance (nautical miles) that the world's safe distance stands for. Of AIS traffic,
    `own` says which ship of an encounter is own ship, `ships` how many target ships are kept at most, and
    `targets` whether they keep the course of their start or replay their tracks. `scene` is the name of the
    only scene to keep.
    """

    safe: Annotated[float, Field(gt=0, le=10)] = 0.3
    own: OwnShip = OwnShip.gives_way
    targets: Targets = Targets.straight
    ships: Annotated[int, Field(ge=1, le=8)] = 3
    scene: str = ""


@dataclass(frozen=True)
class Changes:
    """Keys of the world, a suite's traffic, the perturbation and situations, other than in YAML files."""

    world: dict[str, Any] = field(default_factory=dict)
    traffic: dict[str, Any] = field(default_factory=dict)
    perturbation: Perturbation = Perturbation()
    situations: Situations = Situations()


@dataclass(frozen=True)
class Margin:
    """What training alone adds to the reward, so that ships keep more than the safe distance.

    A step that passes a target ship inside `distance` (m) costs up to `penalty`: nothing at `distance`, all
    of it at the safe distance. Keeping the steering rules earns at most `rules` an episode
    (`sim.rules`). A collision costs `collision`, and twice `rules`, more: it ends the episode, so it must
    cost more than all that is then no longer paid for near passes and broken rules. A truncated
    episode costs `timeout`, less than a collision; above 0, its end counts as final, which needs a network
    that sees the time (Pardo et al., 2018).
    """

    distance: bounds.Bound = 0.0
    penalty: bounds.Bound = 0.0
    rules: bounds.Bound = 0.0
    collision: bounds.Bound = 0.0
    timeout: bounds.Bound = 0.0


def describe_margin(margin: Margin) -> dict[str, float]:
    """Return what a margin adds, as a digest of runs names it."""
    near = {"distance": margin.distance, "penalty": margin.penalty} if margin.penalty else {}
    others = {"rules": margin.rules, "collision": margin.collision, "timeout": margin.timeout}
    return near | {key: value for key, value in others.items() if value}


@dataclass
class Traffic:
    """A distribution of random encounters; conf/suite/traffic.yaml says what each key means."""

    ships: Annotated[list[bounds.Share], bounds.ShipShares]
    classes: Annotated[list[EncounterClass], rule("at least one class of encounter", bool)]
    speeds: bounds.Range
    meeting: bounds.Range
    offset: bounds.Bound
    distance: bounds.Range
    reacting: bounds.Share


@dataclass
class Network:
    """The layers of the network (section 3.5): conv layers for pixels, fully connected ones for a vector.

    `conv` lists conv layers from the picture on, each [filters, kernel, stride], square and without padding.
    `hidden` is the width of the fully connected layer behind them, which value and advantage share.
    `linear` lists the widths of fully connected layers, in place of both; they see the nearest `ships`. The
    first `per_ship` of them see own ship and one target ship at a time. With `encounters` they also see what
    has happened since an encounter began, and the time that is left. `vector_time` is the time whose way
    the speed vectors show in the picture that the conv layers see; 0 draws none.
    """

    conv: list[bounds.ConvNumbers] = field(default_factory=list)
    hidden: Annotated[int, Field(ge=0, le=bounds.MAX_UNITS)] = 0
    linear: list[Annotated[int, Field(ge=1, le=bounds.MAX_UNITS)]] = field(default_factory=list)
    ships: Annotated[int, Field(ge=0, le=bounds.MAX_SHIPS)] = 0
    per_ship: Annotated[int, Field(ge=0, le=bounds.MAX_UNITS)] = 0
    vector_time: bounds.Seconds = 0.0
    encounters: bool = False

    @property
    def own_numbers(self) -> int:
        """How many numbers of own ship a vector has."""
        return bounds.OWN_NUMBERS + self.encounters

    @property
    def ship_numbers(self) -> int:
        """How many numbers of each target ship a vector has."""
        return bounds.SHIP_NUMBERS + bounds.ENCOUNTER_NUMBERS * self.encounters

    @property
    def inputs(self) -> int:
        """How many numbers a vector has."""
        return self.own_numbers + self.ship_numbers * self.ships

    @property
    def depth(self) -> int:
        """How many layers can be copied one by one: those of `conv`, or of `linear`."""
        return len(self.conv) or len(self.linear)


@dataclass
class Learn:
    """Training, as a file of conf/recipe sets it (sections 3.2 and 4.2), and how layers are computed.

    Epsilon is annealed over the share `epsilon_fraction` of the episodes.
    """

    episodes: bounds.Count
    num_envs: bounds.Count
    evaluate_every: bounds.Count
    evaluate_episodes: Annotated[int, Field(ge=1, le=bounds.MAX_DRAWS)]
    jumpstart_draws: Annotated[int, Field(ge=0, le=bounds.MAX_DRAWS)]
    replay_size: bounds.Count
    warmup_steps: Annotated[int, Field(ge=0, le=bounds.MAX_COUNT)]
    epsilon_start: bounds.Share
    epsilon_end: bounds.Share
    epsilon_fraction: bounds.PositiveShare
    gamma: bounds.Share
    lr: bounds.LearningRate
    lr_end: bounds.LearningRate
    batch_size: bounds.Count
    update_every: bounds.Count
    tau: bounds.PositiveShare
    loss: Loss
    huber_delta: Annotated[float, Field(gt=0, le=bounds.MAX_HUBER_DELTA)]
    reward_scale: bounds.RewardScale
    precision: Precision
    backend: BackendName


@dataclass
class Checkpoint:
    """How often a checkpoint is written, from which a stopped run resumes.

    `every` is a share of the episodes, `seconds` the minimum time between two; 0 and 0: after each episode.
    With `keep`, the one of the end stays in the run's folder, so that the run can be extended.
    """

    every: bounds.Share
    seconds: Annotated[float, Field(ge=0)]
    keep: bool = True


@dataclass
class Wandb:
    """Where a wandb run is logged; offline needs no account.

    `folder` holds `wandb/offline-run-*`. With a `group` of None the group is the pair.
    """

    project: str
    mode: WandbMode
    entity: str | None
    folder: bounds.PathName
    group: str | None


if TYPE_CHECKING:
    Transfer = Any
else:
    # The settings of each method of transfer that has some, as its file declares them.
    _fields = [
        (name, form.settings, field(default_factory=form.settings))
        for name, form in forms().items()
        if form.settings
    ]
    Transfer = dataclasses.make_dataclass(
        "Transfer", _fields, frozen=True, namespace={"__module__": __name__}
    )


@dataclass
class Config:
    """One run: an arm on a pair of cases or suites with a seed."""

    pair: bounds.FolderName | None
    source: bounds.PathName | None
    target: bounds.PathName | None
    source_file: bounds.PathName | None
    source_weights: SourceWeights
    demonstrations: bounds.PathName | None
    method: MethodName
    layers: Any
    seed: bounds.Seed
    device: bounds.Device
    fast: bool
    colour: bool
    logger: Logger
    objective: Objective
    output: bounds.PathName
    case_base: bounds.PathName
    overwrite: bool
    profile: str
    perturbation: Perturbation
    world: World
    network: Network
    learn: Learn
    # `build` names the function that makes the learner; the rest are its own keys (checks.py).
    algorithm: dict[str, Any]
    checkpoint: Checkpoint
    wandb: Wandb
    observation: Observation = Observation.pixels
    margin: Margin = field(default_factory=Margin)
    mask: str | None = None
    transfer: Transfer = field(default_factory=Transfer)
    situations: Situations = Situations()
    extend: bool = False

    @property
    def arm(self) -> Arm:
        """The arm of a checked configuration."""
        return Arm(self.method, self.layers, self.source_weights)

    @property
    def arm_label(self) -> str:
        """Name of the arm in folders and results, with a suffix if the run begins with demonstrations."""
        return self.arm.name if self.demonstrations is None else self.arm.name + DEMONSTRATED

    def with_arm(self, arm: Arm) -> Config:
        """Return the configuration with another arm; from scratch it has no source."""
        changes: dict[str, Any] = {"method": arm.method, "layers": arm.layers, "source_weights": arm.weights}
        if arm.is_scratch:
            changes |= {"source": None, "source_file": None}
        return dataclasses.replace(self, **changes)

    def with_episodes(self, episodes: int) -> Config:
        """Return the configuration with another number of training episodes."""
        return dataclasses.replace(self, learn=dataclasses.replace(self.learn, episodes=episodes))

    @property
    def label(self) -> str:
        """Name of the pair: as shipped, else `source-target`, else the target case alone."""
        cases = [stem(case) for case in (self.source, self.target) if case is not None]
        return self.pair or "-".join(cases)


def plain(values: Any) -> Any:
    """Return a config object as dicts, lists and single values, for JSON, YAML and wandb."""
    return OmegaConf.to_container(OmegaConf.structured(values), enum_to_str=True)


def world_values(world: World) -> dict[str, Any]:
    """Return a world as plain values for a digest.

    Keys of the world and its reward that came later are left out at their default, so that digests of older
    worlds stay the same.
    """
    return _without_defaults(world) | {"reward": _without_defaults(world.reward)}


def _without_defaults(values: World | Reward) -> dict[str, Any]:
    defaults = {one.name: one.default for one in dataclasses.fields(values)}
    return {key: value for key, value in plain(values).items() if getattr(values, key) != defaults[key]}
