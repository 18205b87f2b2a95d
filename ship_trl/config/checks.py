"""Checks of a composed configuration, before torch is imported.

Every complaint is a `ConfigError` whose one line names the key and what is allowed.
"""

from __future__ import annotations

import importlib.util
import math
import os
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.arm import ALL_LAYERS, Method, SourceWeights
from ship_trl.config.errors import ConfigError, explain
from ship_trl.config.limits import check_learn, check_memory, check_sizes
from ship_trl.config.network import cut_by_words, geometry
from ship_trl.config.shapes import check_shapes
from ship_trl.config.types import BackendName, Config, Logger, World, bfloat16_allowed

# Bytes of a file's name and of a path, beside what a run adds to them.
LONGEST_NAME, LONGEST_PATH = 200, 3000


def to_config(values: DictConfig) -> Config:
    """Check composed values against the types and return them as a `Config`.

    Merging into the typed schema once more is what catches a typo behind `+`, which Hydra alone
    lets pass.

    Raises:
        ConfigError: an unknown or missing key, a wrong type, or a value out of range.
    """
    try:
        check_shapes(Config, OmegaConf.to_container(values))
        merged = OmegaConf.merge(OmegaConf.structured(Config), whole_numbers_too(values))
        config: Any = OmegaConf.to_object(merged)
    except OmegaConfBaseException as error:
        raise ConfigError(explain(error)) from None
    except RecursionError:
        raise ConfigError("config: interpolations lead to themselves") from None
    except OverflowError:
        raise ConfigError("config: an interpolation leads to a number that is too large") from None
    # Once more, for an interpolation may lead to anything.
    check_shapes(Config, asdict(config))
    check(config)
    return config


def whole_numbers_too(values: DictConfig) -> Any:
    """Return the values with whole numbers in world.actions as floats, which OmegaConf does elsewhere."""
    actions = OmegaConf.select(values, "world.actions")
    if not isinstance(actions, ListConfig):
        return values
    rows: Any = OmegaConf.to_container(actions)
    rows = [
        [float(v) if type(v) is int else v for v in row] if isinstance(row, list) else row for row in rows
    ]
    return OmegaConf.merge(values, {"world": {"actions": rows}})


def require(condition: bool, key: str, allowed: str, got: object) -> None:
    """Raise a `ConfigError` naming `key`, what is `allowed` and what was given."""
    if not condition:
        raise ConfigError(f"{key}: must be {allowed}, got {got}")


def at_least(least: float, keys: dict[str, float]) -> None:
    """Check that every named number is finite and not below `least`."""
    for key, value in keys.items():
        require(least <= value < math.inf, key, f"at least {least}", value)


def positive(keys: dict[str, float]) -> None:
    """Check that every named number is finite and above 0."""
    for key, value in keys.items():
        require(0 < value < math.inf, key, "above 0", value)


def within(keys: dict[str, float]) -> None:
    """Check that every named number lies in [0, 1]."""
    for key, value in keys.items():
        require(0.0 <= value <= 1.0, key, "from 0 to 1", value)


def named(prefix: str, values: object, fields: str) -> dict[str, float]:
    """Return the fields of a dataclass under their full keys."""
    return {f"{prefix}.{name}": getattr(values, name) for name in fields.split()}


def check(config: Config) -> None:
    """Check ranges and what the keys say together (cases are checked where they are loaded)."""
    bfloat16_allowed()
    learn, world = config.learn, config.world
    counts = "episodes num_envs batch_size replay_size update_every evaluate_every"
    at_least(1, named("learn", learn, counts))
    at_least(0, named("learn", learn, "warmup_steps jumpstart_draws") | {"seed": config.seed})
    positive(named("learn", learn, "lr lr_end reward_scale huber_delta"))
    within(named("learn", learn, "gamma tau epsilon_start epsilon_end epsilon_fraction"))
    positive(named("learn", learn, "tau epsilon_fraction"))
    within(named("checkpoint", config.checkpoint, "every"))
    at_least(0, named("checkpoint", config.checkpoint, "seconds"))
    require(
        learn.batch_size <= learn.replay_size,
        "learn.batch_size",
        f"at most learn.replay_size={learn.replay_size}",
        learn.batch_size,
    )
    check_world(world)
    check_learn(learn, world)
    known = re.fullmatch(r"cpu|cuda(:\d{1,3})?", config.device, re.ASCII)
    require(known is not None, "device", "cpu or cuda", config.device)
    require(
        learn.backend is not BackendName.incremental or config.device == "cpu",
        "learn.backend",
        f"auto or dense with device={config.device}",
        learn.backend.value,
    )
    layers = geometry(config.network)
    require(
        learn.backend is not BackendName.incremental or cut_by_words(layers),
        "learn.backend",
        f"auto or dense with network.conv={config.network.conv}",
        learn.backend.value,
    )
    check_logger(config.logger)
    check_names(config)
    check_arm(config)
    # It asks the arm, which must be one.
    check_memory(config, layers)


def check_world(world: World) -> None:
    """Check the physics and the reward."""
    positive(named("world", world, "dt max_steps safe_distance goal_distance"))
    require(
        all(len(a) == 2 and all(map(math.isfinite, a)) for a in world.actions)
        and any(v > 0 for v, _ in world.actions),
        "world.actions",
        "a list of [v in m/s, omega in rad/s], at least one with v above 0",
        world.actions,
    )
    check_sizes(world)


def check_names(config: Config) -> None:
    """Check what becomes a file's name or a path."""
    if config.pair is not None:
        right = is_path(config.pair) and "/" not in config.pair and config.pair not in ("", ".", "..")
        require(right, "pair", "the name of a folder", config.pair)
    paths = {
        key: getattr(config, key)
        for key in ("output", "case_base", "source", "target", "source_file", "demonstrations")
    }
    for key, path in (paths | {"wandb.folder": config.wandb.folder}).items():
        allowed = f"a path of at most {LONGEST_PATH} bytes, {LONGEST_NAME} a name"
        # An empty output, as of an unset variable of a shell, would be the folder that one works in.
        named = path != "" or key not in ("output", "case_base", "wandb.folder")
        require(path is None or (named and is_path(path)), key, allowed, path)


def is_path(text: str) -> bool:
    """Whether a file system may take a text for a path, with a little added to it."""
    try:
        names = [os.fsencode(name) for name in Path(text).parts]
    except UnicodeEncodeError:
        return False
    short = sum(map(len, names)) + len(names) <= LONGEST_PATH
    return short and all(len(name) <= LONGEST_NAME and b"\0" not in name for name in names)


def check_logger(logger: Logger) -> None:
    """Check that TensorBoard, an extra, is installed where it is asked for."""
    if logger.includes(Logger.tensorboard) and importlib.util.find_spec("tensorboard") is None:
        raise ConfigError(f"logger: {logger.name} needs TensorBoard; ship_trl[tensorboard] brings it")


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
