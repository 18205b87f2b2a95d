"""Check keys of a configuration against one another; bounds of one key are in types.py. No torch.

Every error is a `ConfigError` whose one line names the key and what is allowed.
"""

from __future__ import annotations

import importlib.util

from omegaconf import DictConfig

from ship_trl.config.algorithm import read_algorithm, reads_of
from ship_trl.config.arm import BODY, FORMS, HEAD, SourceWeights, TransferMethodName
from ship_trl.config.bounds import MAX_DISTANCE, PICTURE
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.network import Geometry, geometry, linear_from, linear_sizes, supports_incremental
from ship_trl.config.schema import read_as
from ship_trl.config.types import BackendName, Config, Observation, World, bfloat16_allowed, trackers_of

# The planner tries each action at each step: ten actions and a thousand steps take it about ten minutes.
MAX_ACTIONS, MAX_PLANNED = 100, 10_000
# Metres of the fastest action in an episode, where 32-bit numbers still resolve decimetres.
MAX_EPISODE_METRES = 1e6
# Numbers in the maps of a batch: 4 GB. Weights: 2 GB with Adam's two means, gradient and target network.
MAX_MAP_NUMBERS, MAX_WEIGHTS = 1_000_000_000, 100_000_000
# Bytes of the replay in memory; a transition of two states with eight target ships takes 406.
MAX_REPLAY_BYTES, TRANSITION_BYTES = 2**33, 406


def to_config(values: DictConfig) -> Config:
    """Check composed values and return them as a `Config`, or raise a `ConfigError`."""
    config = read_as(Config, values)
    bfloat16_allowed()
    check_world(config.world)
    learn = config.learn
    allowed = f"at most learn.replay_size={learn.replay_size}"
    require(learn.batch_size <= learn.replay_size, "learn.batch_size", allowed, learn.batch_size)
    check_margin(config)
    config.algorithm = read_algorithm(config.algorithm, learn)
    reads = reads_of(config.algorithm)
    if reads.is_on_policy:
        allowed = "left out with an algorithm that learns from its own actions alone"
        require(config.demonstrations is None, "demonstrations", allowed, config.demonstrations)
        without = not FORMS[config.method].uses_function
        allowed = "another with an algorithm that has no Q-values"
        require(without, "method", allowed, config.method.value)
    if reads.is_distilled and config.method is TransferMethodName.q_reuse:
        allowed = "another with an algorithm that learns the Q-values of a teacher"
        require(False, "method", allowed, config.method.value)
    # The network limits the layers of the arm, and the arm says how many of them are frozen.
    layers = geometry(config.network)
    check_observation(config)
    check_backend(config, layers)
    check_logger(config.logger)
    check_arm(config)
    check_memory(config, layers)
    return config


def require(condition: bool, key: str, allowed: str, got: object) -> None:
    """Raise a `ConfigError` that names `key`, what is `allowed` and what was given."""
    if not condition:
        raise ConfigError(f"{key}: must be {allowed}, got {got}")


def require_at_most(most: float, key: str, value: float, why: str) -> None:
    """Raise a `ConfigError` if a value is larger than `most`."""
    allowed, got = (str(one) if type(one) is int else f"{one:g}" for one in (most, value))
    require(value <= most, key, f"at most {allowed} ({why})", got)


def check_world(world: World) -> None:
    """Check the number of actions, and how far a ship moves in an episode."""
    key, steps = "world.actions", world.max_steps
    most_actions = min(MAX_ACTIONS, MAX_PLANNED // steps)
    require_at_most(most_actions, key, len(world.actions), "their number; the planner tries all")
    way = max(abs(speed) * world.dt for speed, _ in world.actions) * steps
    require(way <= MAX_EPISODE_METRES, key, f"at most {MAX_EPISODE_METRES:g} m in an episode", f"{way:g}")
    why = "metres that the fastest action makes in an episode"
    require_at_most(min(MAX_DISTANCE, way), "world.goal_distance", world.goal_distance, why)


def check_margin(config: Config) -> None:
    """Check that a cost of near passes begins outside the safe distance."""
    margin, safe = config.margin, config.world.safe_distance
    allowed = f"above world.safe_distance={safe:g} with margin.penalty={margin.penalty:g}"
    require(not margin.penalty or margin.distance > safe, "margin.distance", allowed, f"{margin.distance:g}")


def check_observation(config: Config) -> None:
    """Check that the network sees what is observed, and that a vector comes with no setting of pixels."""
    seen, network, learn = config.observation, config.network, config.learn
    fitting, layers = (Observation.vector, "linear") if network.linear else (Observation.pixels, "conv")
    require(seen is fitting, "observation", f"{fitting.name} with network.{layers}", seen.name)
    if seen is Observation.vector:
        allowed = "with observation=vector"
        require(not config.colour, "colour", f"false {allowed}", "true")
        is_dense = learn.backend is not BackendName.incremental
        require(is_dense, "learn.backend", f"auto or dense {allowed}", learn.backend.name)


def check_backend(config: Config, layers: Geometry) -> None:
    """Check that `learn.backend=incremental` can compute the network; `fast=false` makes all layers dense."""
    if config.learn.backend is BackendName.incremental:
        key, name = "learn.backend", config.learn.backend.name
        require(config.fast, key, "auto or dense with fast=false", name)
        require(config.device == "cpu", key, f"auto or dense with device={config.device}", name)
        allowed = f"auto or dense with network.conv={config.network.conv}"
        require(supports_incremental(layers), key, allowed, name)
    if not config.fast:
        config.learn.backend = BackendName.dense


def check_memory(config: Config, layers: Geometry) -> None:
    """Check what a run holds at once: weights, maps and replay."""
    learn, network, channels = config.learn, config.network, 3 if config.colour else 1
    if network.linear:
        key, sizes = "network.linear", linear_sizes(network)
        weights, maps = sum(below * width for below, width in sizes), network.inputs + sum(network.linear)
        maps += (network.ships - 1) * sum(network.linear[: network.per_ship])
    else:
        key, weights, below = "network.conv", 0, channels
        for layer in layers:
            weights, below = weights + below * layer.filters * layer.kernel**2, layer.filters
        weights += below * network.hidden
        maps = channels * PICTURE**2 + sum(layer.filters * layer.side**2 for layer in layers)
    require_at_most(MAX_WEIGHTS, key, weights, "weights; they take 2 GB in training")
    batches = {"learn.num_envs": learn.num_envs, "learn.batch_size": learn.batch_size}
    if key_of_batch := reads_of(config.algorithm).batch_key:
        batches[f"algorithm.{key_of_batch}"] = config.algorithm[key_of_batch]
    for name, value in batches.items():
        require_at_most(MAX_MAP_NUMBERS // maps, name, value, f"4 GB of the maps of {key}")
    size, frozen = TRANSITION_BYTES, config.arm.frozen_layers
    is_incremental = learn.backend is not BackendName.dense and supports_incremental(layers)
    # Double DQN then stores two states as features of the frozen layers, two bytes a number.
    if config.device == "cpu" and is_incremental and frozen >= linear_from(layers):
        size += 4 * layers[frozen - 1].filters * layers[frozen - 1].side ** 2
    if network.linear:
        # It stores two vectors of float32 in place of two states.
        size += 8 * network.inputs
    most = MAX_REPLAY_BYTES // size
    require_at_most(most, "learn.replay_size", learn.replay_size, f"{MAX_REPLAY_BYTES >> 30} GB")


def check_logger(logger: str) -> None:
    """Check that TensorBoard, an extra, is installed if it is asked for."""
    if "tensorboard" in trackers_of(logger) and importlib.util.find_spec("tensorboard") is None:
        raise ConfigError(f"logger: {missing_extra('tensorboard', 'tensorboard')}")


def check_arm(config: Config) -> None:
    """Check method, layers, source and target against one another."""
    method, layers, weights = config.method, config.layers, config.source_weights
    if config.target is None:
        raise ConfigError(
            "pair: none given; give +pair=NAME (see --help for the names), "
            "or source=CASE target=CASE, or method=scratch target=CASE"
        )
    if method is TransferMethodName.scratch:
        require(layers is None, "layers", "left out with method=scratch", layers)
        require(config.source_file is None, "source_file", "left out with method=scratch", config.source_file)
        learned = weights is SourceWeights.learned
        require(learned, "source_weights", "learned with method=scratch", weights.value)
        return
    if config.source_file is not None:
        is_read = weights in (SourceWeights.learned, SourceWeights.permuted)
        require(is_read, "source_weights", "learned or permuted with a source_file", weights.value)
    if config.source == SourceWeights.pretrained.value:
        left_out = f"left out with source={config.source}"
        is_bundled = weights in (SourceWeights.learned, SourceWeights.pretrained)
        require(is_bundled, "source_weights", left_out, weights.value)
        require(config.source_file is None, "source_file", left_out, config.source_file)
    source = f"a case, for method={method.value}; without a source method=scratch"
    require(config.source is not None, "source", source, "none")
    form, counts = FORMS[method], range(1, config.network.depth + 1)
    *others, last = [*map(str, counts), *form.words]
    numbers = f"{', '.join(others)} or {last}"
    if layers is None and not form.bare:
        raise ConfigError(
            f"layers: none given; give layers={numbers} with method={method.value}, "
            "or arm=NAME, which sets both (see --help for the names)"
        )
    known = layers in form.words or (type(layers) is int and layers in counts) or layers is None
    numbers += ", or left out" * form.bare
    require(known, "layers", f"{numbers} with method={method.value}", layers)
    if layers == BODY or (layers == HEAD and method is TransferMethodName.feature_extraction):
        # The layers of a network of numbers are all fully connected, and counted.
        require(bool(config.network.conv), "layers", "a number or all with observation=vector", layers)
    if form.uses_function:
        is_trained = weights in (SourceWeights.learned, SourceWeights.pretrained)
        allowed = f"learned or pretrained with method={method.value}"
        require(is_trained, "source_weights", allowed, weights.value)
