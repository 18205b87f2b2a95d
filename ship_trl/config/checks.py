"""Check keys of a configuration against one another; bounds of one key are in types.py. No torch.

Every error is a `ConfigError` whose one line names the key and what is allowed. A bundled algorithm says what
it reads in `READS` of the module `settings` beside its own; a builder of one's own takes any keys.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from ship_trl.config.arm import BODY, HEAD, SourceWeights, forms
from ship_trl.config.errors import ConfigError, missing_extra, require
from ship_trl.config.network import count_numbers, geometry, linear_from, supports_incremental
from ship_trl.config.paths import PACKAGE
from ship_trl.config.schema import read_as
from ship_trl.config.types import BackendName, Config, Learn, bfloat16_allowed, plain, trackers_of

# Bytes that each of a run's weights, batches, replay and planner may take.
MAX_BYTES = 2**33
# A weight has a gradient, Adam's two means, and its copy in the target network. A map is held forward and
# backward. A transition has two states of eight target ships.
WEIGHT_BYTES, MAP_BYTES, TRANSITION_BYTES = 20, 12, 726
# The planner tries each motion from that many rows a step, at 96 angles.
MOTION_BYTES = 2 * 96 * 200
# Masks by name, each the function that makes it of a world.
MASKS = {"rules": "ship_trl.policies.masks:RulesMask"}
# Metres of an episode, up to which 32-bit numbers still resolve decimetres.
MAX_WAY = 1e6


@dataclass(frozen=True)
class Reads:
    """What an algorithm reads.

    Attributes:
        settings: the dataclass of its own keys; a method `check` gets `learn`. None takes any keys.
        ignored: keys of others that it does not read.
        is_default: whether files and digests leave it out.
        is_on_policy: whether it learns from its own actions alone, without replay and Q-values.
        is_distilled: whether it learns the Q-values of a teacher.
        batch_key: its own key of a batch's size, in place of `learn.batch_size`.
        unnamed_without: its own keys that files and digests leave out where the key before them is 0.
    """

    settings: type | None = None
    ignored: tuple[str, ...] = ()
    is_default: bool = False
    is_on_policy: bool = False
    is_distilled: bool = False
    batch_key: str = ""
    unnamed_without: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def to_config(values: DictConfig) -> Config:
    """Check composed values and return them as a `Config`, or raise a `ConfigError`."""
    config = read_as(Config, values)
    bfloat16_allowed()
    learn, margin, safe = config.learn, config.margin, config.world.safe_distance
    allowed = f"at most learn.replay_size={learn.replay_size}"
    require(learn.batch_size <= learn.replay_size, "learn.batch_size", allowed, learn.batch_size)
    allowed = f"above world.safe_distance={safe:g} with margin.penalty={margin.penalty:g}"
    require(not margin.penalty or margin.distance > safe, "margin.distance", allowed, f"{margin.distance:g}")
    if config.mask not in (None, *MASKS):
        check_function("mask", config.mask, f"null, {', '.join(MASKS)}, ")
    config.algorithm = read_algorithm(config.algorithm, learn)
    check_network(config)
    check_logger(config.logger)
    check_arm(config)
    check_memory(config)
    check_algorithm(config)
    return config


def reads_of(algorithm: Mapping[str, Any]) -> Reads:
    """Return what an algorithm reads; any keys if it does not say."""
    package, _, name = str(algorithm["build"]).rpartition(":")[0].rpartition(".")
    # Files may name any package, which must not be imported for that.
    if package != f"{PACKAGE.name}.learn":
        return Reads()
    found: Reads = importlib.import_module(f"{package}.settings").READS.get(name, Reads())
    return found


def read_algorithm(values: dict[str, Any], learn: Learn) -> dict[str, Any]:
    """Check `build` and the keys that it reads; return them with their types.

    Raises:
        ConfigError: `build` names no function, its file or package is missing, or a key is unknown or wrong.
    """
    build = values.get("build")
    check_function("algorithm.build", build)
    if (kind := reads_of(values).settings) is None:
        return values
    own = {key: value for key, value in values.items() if key != "build"}
    settings: Any = read_as(kind, own, key="algorithm")
    if hasattr(settings, "check"):
        settings.check(learn)
    return {"build": build, **dataclasses.asdict(settings)}


def check_function(key: str, name: object, words: str = "") -> None:
    """Check that a setting names a function of a module or file that exists; `words` are allowed too."""
    where, _, function = str(name).rpartition(":")
    if where.endswith(".py"):
        is_there = Path(where).is_file()
    else:
        parts = where.split(".")
        is_name = all(map(str.isidentifier, parts))
        # A script that runs has no spec to find.
        is_there = is_name and (parts[0] in sys.modules or importlib.util.find_spec(parts[0]) is not None)
    allowed = f"{words}module:function or file.py:function, of a module or file that exists"
    require(function.isidentifier() and is_there, key, allowed, name)


def ignored_keys(algorithm: Mapping[str, Any], words: Iterable[str]) -> list[str]:
    """Return the keys of a command line that an algorithm does not read."""
    keys = (word.partition("=")[0].lstrip("+") for word in words)
    return [key for key in keys if key in reads_of(algorithm).ignored]


def named_learn(learn: Learn) -> dict[str, Any]:
    """Return the values of training that decide what is learned, as files of runs and studies name them.

    Backends, like devices, only round differently.
    """
    values = plain(learn)
    del values["backend"]
    return values


def non_default_algorithm(algorithm: dict[str, Any]) -> dict[str, Any] | None:
    """Return the values of `algorithm` that files and digests hold; None for the paper's."""
    reads = reads_of(algorithm)
    if reads.is_default:
        return None
    unnamed = {key for first, keys in reads.unnamed_without.items() if not algorithm[first] for key in keys}
    return {key: value for key, value in algorithm.items() if key not in unnamed}


def check_network(config: Config) -> None:
    """Check that the network sees what is observed, and that the backend can compute it."""
    network, learn, seen = config.network, config.learn, config.observation.name
    layers = geometry(network)
    fitting, kind = ("vector", "linear") if network.linear else ("pixels", "conv")
    require(seen == fitting, "observation", f"{fitting} with network.{kind}", seen)
    require(not (network.linear and config.colour), "colour", "false with observation=vector", "true")
    if learn.backend is BackendName.incremental:
        for is_possible, with_what in (
            (not network.linear, "observation=vector"),
            (config.fast, "fast=false"),
            (config.device == "cpu", f"device={config.device}"),
            (supports_incremental(layers), f"network.conv={network.conv}"),
        ):
            require(is_possible, "learn.backend", f"auto or dense with {with_what}", "incremental")
    if not config.fast:
        learn.backend = BackendName.dense


def check_memory(config: Config) -> None:
    """Check by an estimate that weights, batches, replay and the planner of a run fit into memory."""
    learn, network, layers, world = config.learn, config.network, geometry(config.network), config.world
    weights, maps = count_numbers(network, 3 if config.colour else 1)
    key, batch, frozen = "learn.batch_size", learn.batch_size, config.arm.frozen_layers
    if own := reads_of(config.algorithm).batch_key:
        key, batch = f"algorithm.{own}", config.algorithm[own]
    transition = TRANSITION_BYTES
    is_dense = config.device != "cpu" or learn.backend is BackendName.dense
    if layers and frozen >= linear_from(layers) and supports_incremental(layers) and not is_dense:
        # The replay holds features of both states too, two bytes a number.
        transition += 4 * layers[frozen - 1].filters * layers[frozen - 1].side ** 2
    motions = len(world.actions)
    if world.turn_time or world.speed_time:
        motions = math.prod(len(set(column)) for column in zip(*world.actions, strict=True))
    check_bytes(f"network.{'linear' if network.linear else 'conv'}", weights, "weights", WEIGHT_BYTES)
    check_bytes("learn.num_envs", learn.num_envs, "observations", MAP_BYTES * maps)
    check_bytes(key, batch, "observations", MAP_BYTES * maps)
    check_bytes("learn.replay_size", learn.replay_size, "transitions", transition)
    check_bytes("world.actions", motions, "motions", MOTION_BYTES * world.max_steps)
    way = max(abs(speed) for speed, _ in world.actions) * world.dt * world.max_steps
    require(way <= MAX_WAY, "world.actions", f"at most {MAX_WAY:g} m in an episode", f"{way:g}")


def check_bytes(key: str, number: int, things: str, size: int) -> None:
    """Check that a number of things of `size` bytes each fits into memory."""
    allowed = f"at most {MAX_BYTES // size} {things} ({MAX_BYTES >> 30} GB, {size} bytes each)"
    require(number * size <= MAX_BYTES, key, allowed, number)


def check_logger(logger: str) -> None:
    """Check that TensorBoard, an extra, is installed if it is asked for."""
    if "tensorboard" in trackers_of(logger) and importlib.util.find_spec("tensorboard") is None:
        raise ConfigError(f"logger: {missing_extra('tensorboard', 'tensorboard')}")


def check_arm(config: Config) -> None:
    """Check method, layers, source and target against one another."""
    layers, weights, file = config.layers, config.source_weights, config.source_file
    learned, pretrained = weights is SourceWeights.learned, weights is SourceWeights.pretrained
    given = f"with method={config.method}"
    if config.target is None:
        raise ConfigError(
            "pair: none given; give +pair=NAME (see --help for the names), "
            "or source=CASE target=CASE, or method=scratch target=CASE"
        )
    if config.method == "scratch":
        require(layers is None, "layers", f"left out {given}", layers)
        require(file is None, "source_file", f"left out {given}", file)
        require(learned, "source_weights", f"learned {given}", weights)
        return
    if file is not None:
        is_read = learned or weights is SourceWeights.permuted
        require(is_read, "source_weights", "learned or permuted with a source_file", weights)
    if config.source == SourceWeights.pretrained:
        require(learned or pretrained, "source_weights", "left out with source=pretrained", weights)
        require(file is None, "source_file", "left out with source=pretrained", file)
    require(config.source is not None, "source", f"a case {given}; without one method=scratch", "none")
    form = forms()[config.method]
    possible = [*range(1, config.network.depth + 1), *form.words]
    is_possible = layers in possible if type(layers) in (int, str) else layers is None and form.bare
    allowed = ", ".join([*map(str, possible), *["left out"] * form.bare])
    got = f"{'none' if layers is None else layers}; arm=NAME sets both"
    require(is_possible, "layers", f"{allowed} {given}", got)
    if layers == BODY or (layers == HEAD and config.method == "feature_extraction"):
        # The layers of a network of numbers are all fully connected, and counted.
        require(bool(config.network.conv), "layers", "a number or all with observation=vector", layers)
    if form.uses_function:
        require(learned or pretrained, "source_weights", f"learned or pretrained {given}", weights)


def check_algorithm(config: Config) -> None:
    """Check that the algorithm can do what the method and demonstrations need."""
    reads, method = reads_of(config.algorithm), config.method
    if reads.is_on_policy:
        allowed = "left out with an algorithm that learns from its own actions alone"
        require(config.demonstrations is None, "demonstrations", allowed, config.demonstrations)
        uses_function = method != "scratch" and forms()[method].uses_function
        require(not uses_function, "method", "another with an algorithm that has no Q-values", method)
    if reads.is_distilled:
        allowed = "another with an algorithm that learns the Q-values of a teacher"
        require(method != "q_reuse", "method", allowed, method)
