"""What several keys of a configuration must fulfil together; bounds of one key are in types.py. No torch.

Every error is a `ConfigError` whose one line names the key and what is allowed.
"""

from __future__ import annotations

import importlib.util

from omegaconf import DictConfig

from ship_trl.config.arm import ALL_LAYERS, Method, SourceWeights
from ship_trl.config.bounds import MAX_DISTANCE
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.network import Geometry, geometry, linear_from, supports_incremental
from ship_trl.config.schema import read_as
from ship_trl.config.types import (
    PICTURE,
    BackendName,
    Config,
    Logger,
    Network,
    World,
    bfloat16_allowed,
)

# The planner tries each action at each step: ten actions and a thousand steps take it about ten minutes.
MAX_ACTIONS, MAX_PLANNED = 100, 10_000
# Metres of the fastest action: in a step more than what rounding changes, in an episode so few that 32-bit
# numbers tell decimetres. Radians that an episode turns by, told to a thousandth.
MIN_STEP_METRES, MAX_EPISODE_METRES, MAX_EPISODE_TURN = 1e-3, 1e6, 1e4
# A step's reward as the learner gets it: a return of a thousand such can be squared.
MAX_SCALED_REWARD = 1e9
# Numbers of the conv layers' maps that are held at once, 4 GB; weights, which with Adam's two means, the
# gradient and the target network take 2 GB.
MAX_MAP_NUMBERS, MAX_WEIGHTS = 1_000_000_000, 100_000_000
# Bytes of the replay, which a machine must hold at once: a transition of two states takes 60.
MAX_REPLAY_BYTES, TRANSITION_BYTES = 2**33, 60


def to_config(values: DictConfig) -> Config:
    """Check composed values and return them as a `Config`.

    Raises:
        ConfigError: an unknown or missing key, a wrong type, or a value that is not allowed.
    """
    config = read_as(Config, values)
    bfloat16_allowed()
    check_world(config.world)
    check_learner(config)
    check_backend(config)
    check_logger(config.logger)
    check_arm(config)
    # The arm says how many layers are frozen, so it is checked first.
    check_memory(config, geometry(config.network))
    return config


def require(condition: bool, key: str, allowed: str, got: object) -> None:
    """Raise a `ConfigError` that names `key`, what is `allowed` and what was given."""
    if not condition:
        raise ConfigError(f"{key}: must be {allowed}, got {got}")


def require_at_most(most: float, key: str, value: float, why: str) -> None:
    """Raise a `ConfigError` where a value is larger than `most`."""
    allowed, got = (str(one) if type(one) is int else f"{one:g}" for one in (most, value))
    require(value <= most, key, f"at most {allowed} ({why})", got)


def check_world(world: World) -> None:
    """Check how far, how long and how sharply an episode leads."""
    speeds = [speed * world.dt for speed, _ in world.actions]
    fastest, turn = max(map(abs, speeds)), max(abs(turn) for _, turn in world.actions) * world.dt
    most_actions = min(MAX_ACTIONS, MAX_PLANNED // world.max_steps)
    require_at_most(most_actions, "world.actions", len(world.actions), "their number; the planner tries all")
    allowed = f"at least {MIN_STEP_METRES:g} m in a step of world.dt={world.dt:g} s"
    require(max(speeds) >= MIN_STEP_METRES, "world.actions", allowed, f"{max(speeds):g}")
    way, turned = fastest * world.max_steps, turn * world.max_steps
    allowed = f"at most {MAX_EPISODE_METRES:g} m in an episode"
    require(way <= MAX_EPISODE_METRES, "world.actions", allowed, f"{way:g}")
    allowed = f"a turn of at most {MAX_EPISODE_TURN:g} rad in an episode"
    require(turned <= MAX_EPISODE_TURN, "world.actions", allowed, f"{turned:g}")
    reach = min(MAX_DISTANCE, way)
    key, why = "world.goal_distance", "metres that the fastest action makes in an episode"
    require_at_most(reach, key, world.goal_distance, why)


def max_step_reward(world: World) -> float:
    """Return a bound of what one step of the paper's reward costs or pays."""
    reward, fastest = world.reward, max(abs(speed) for speed, _ in world.actions)
    farthest = world.goal_distance + 2 * fastest * world.dt * world.max_steps
    shaping = abs(reward.w3 * reward.k1) * farthest + abs(reward.w4 * reward.k2) * 180
    return abs(reward.w1 * reward.goal) + abs(reward.w2 * reward.collision) + shaping


def check_learner(config: Config) -> None:
    """Check the batch against the replay, and the size of scaled rewards."""
    learn = config.learn
    allowed = f"at most learn.replay_size={learn.replay_size}"
    require(learn.batch_size <= learn.replay_size, "learn.batch_size", allowed, learn.batch_size)
    scale = MAX_SCALED_REWARD / max(max_step_reward(config.world), 1e-30)
    require_at_most(scale, "learn.reward_scale", learn.reward_scale, "with the constants of world.reward")


def check_backend(config: Config) -> None:
    """Check that the incremental backend, where it is asked for, can compute the network."""
    key, name = "learn.backend", config.learn.backend
    if name is BackendName.incremental:
        require(config.device == "cpu", key, f"auto or dense with device={config.device}", name.value)
        allowed = f"auto or dense with network.conv={config.network.conv}"
        require(supports_incremental(geometry(config.network)), key, allowed, name.value)


def count_weights(network: Network, channels: int, layers: Geometry) -> int:
    """Count the weights of the conv layers and the shared layer."""
    maps = [channels, *(layer.filters for layer in layers)]
    conv = sum(below * layer.filters * layer.kernel**2 for below, layer in zip(maps, layers, strict=False))
    return conv + maps[-1] * network.hidden


def check_memory(config: Config, layers: Geometry) -> None:
    """Check what a run holds at once: weights, maps and replay."""
    learn, channels = config.learn, 3 if config.colour else 1
    weights = count_weights(config.network, channels, layers)
    require_at_most(MAX_WEIGHTS, "network.conv", weights, "weights; they take 2 GB in training")
    maps = channels * PICTURE**2 + sum(layer.filters * layer.side**2 for layer in layers)
    for key in ("num_envs", "batch_size"):
        most = MAX_MAP_NUMBERS // maps
        require_at_most(most, f"learn.{key}", getattr(learn, key), "4 GB of the maps of network.conv")
    size = TRANSITION_BYTES
    is_incremental = learn.backend is not BackendName.dense and supports_incremental(layers)
    frozen = config.arm.frozen_layers
    # `Agent` then stores two states as features of the frozen layers, two bytes a number.
    if config.device == "cpu" and is_incremental and frozen >= linear_from(layers):
        last = layers[frozen - 1]
        size += 4 * last.filters * last.side**2
    most = MAX_REPLAY_BYTES // size
    require_at_most(most, "learn.replay_size", learn.replay_size, f"{MAX_REPLAY_BYTES >> 30} GB")


def check_logger(logger: Logger) -> None:
    """Check that TensorBoard, an extra, is installed where it is asked for."""
    if logger.includes(Logger.tensorboard) and importlib.util.find_spec("tensorboard") is None:
        raise ConfigError(f"logger: {missing_extra('tensorboard', 'tensorboard')}")


def check_arm(config: Config) -> None:
    """Check method, layers, source and target against one another."""
    layers, weights = config.layers, config.source_weights
    if config.target is None:
        raise ConfigError(
            "pair: none given; give +pair=NAME (see --help for the names), "
            "or source=CASE target=CASE, or method=scratch target=CASE"
        )
    if config.method is Method.scratch:
        require(layers is None, "layers", "left out with method=scratch", layers)
        require(config.source_file is None, "source_file", "left out with method=scratch", config.source_file)
        learned = weights is SourceWeights.learned
        require(learned, "source_weights", "learned with method=scratch", weights.value)
        return
    read = weights in (SourceWeights.learned, SourceWeights.permuted)
    both = not read and config.source_file is not None
    require(not both, "source_weights", "learned or permuted with a source_file", weights.value)
    if config.source == SourceWeights.pretrained.value:
        left_out = f"left out with source={config.source}"
        came = weights in (SourceWeights.learned, SourceWeights.pretrained)
        require(came, "source_weights", left_out, weights.value)
        require(config.source_file is None, "source_file", left_out, config.source_file)
    require(config.source is not None, "source", f"a case, for method={config.method.value}", "none")
    counts = range(1, len(config.network.conv) + 1)
    numbers = ", ".join(map(str, counts)) + (" or all" if config.method is Method.finetune else "")
    if layers is None:
        raise ConfigError(
            f"layers: none given; give layers={numbers} with method={config.method.value}, "
            "or +arm=NAME, which sets both (see --help for the names)"
        )
    known = type(layers) is int and layers in counts
    whole = layers == ALL_LAYERS and config.method is Method.finetune
    require(known or whole, "layers", f"{numbers} with method={config.method.value}", layers)
