"""Kinds of input, each with what is tried of it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hypothesis.strategies import SearchStrategy, sampled_from
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.cli.errors import hydra_errors, refusals
from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import geometry
from ship_trl.config.paths import conf_dir
from ship_trl.run.plan import make_run
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.manifest import run_config
from tests.fuzz import case_files, commands, lines, readers, settings, trees
from tests.fuzz.judge import complaint, heard, in_time, learn, leaves_nothing, refusal, sail

# What a network is tried on: more would make a test slow.
SMALL_WEIGHTS, SMALL_MAPS = 100_000, 1_000_000
# Transitions; they are written over as they are made.
SMALL_REPLAY = 100_000
SMALL_NETWORK = {"conv": [[4, 8, 4], [6, 20, 1]], "hidden": 8}
_base: list[DictConfig] = []


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    `attempt` returns whether an input ran; False means that it was refused as it should be.
    """

    inputs: SearchStrategy[Any]
    attempt: Callable[[Any], bool]


def composed(line: list[str]) -> DictConfig:
    """Compose as the command does."""
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        values = compose("config", line)
    assert isinstance(values, DictConfig)
    return values


def base() -> DictConfig:
    """The configuration that others differ from, composed once."""
    if not _base:
        _base.append(composed(["target=2", "method=scratch", "profile=smoke"]))
    return _base[0].copy()


def overrides(line: list[str]) -> bool:
    """Compose a command line, plan its run and sail in its world."""
    folder = Path.cwd()
    # The command begins without it.
    os.environ.pop("HYDRA_FULL_ERROR", None)
    with in_time(), leaves_nothing(folder), heard() as said:
        try:
            with hydra_errors():
                values = composed(line)
                with refusals():
                    config = to_config(values)
                    run = make_run(config)
        except SystemExit as error:
            complaint(error, said.getvalue(), "run", " ".join(line))
            return False
        sail(run.target, config.world, config.colour)
    return True


def study(line: list[str]) -> bool:
    """Read what a study is asked to be, and what its runs share."""
    with in_time(), heard() as said:
        try:
            with refusals():
                run_config(to_study(line))
        except SystemExit as error:
            complaint(error, said.getvalue(), "study", " ".join(line))
            return False
    return True


def configuration(changes: dict[str, Any]) -> bool:
    """Check a configuration that a program made, with some groups changed."""
    values = base()
    OmegaConf.set_struct(values, False)
    try:
        for group, value in changes.items():
            # Of the learner some settings, of others the whole.
            values[group] = {**values[group], **value} if group == "learn" and some_settings(value) else value
    except OmegaConfBaseException:
        # It cannot be written down.
        return False
    with in_time():
        try:
            config = to_config(values)
            run = make_run(config)
        except ConfigError as error:
            refusal(error, "run", str(changes))
            return False
        sail(run.target, config.world, config.colour)
        if small(config.network, config.learn):
            learn(config.network, config.learn)
    return True


def some_settings(learn: Any) -> bool:
    """Whether these are some settings of the learner."""
    return isinstance(learn, dict) and len(learn) < 5


def small(network: Any, settings: Any) -> bool:
    """Whether a network is built and takes a step in a moment."""
    layers = geometry(network)
    below = [1, *(layer.filters for layer in layers)]
    weights = sum(n * layer.filters * layer.kernel**2 for n, layer in zip(below, layers, strict=False))
    maps = sum(layer.filters * layer.side**2 for layer in layers)
    held = settings.replay_size < SMALL_REPLAY
    return held and weights < SMALL_WEIGHTS and maps * settings.batch_size < SMALL_MAPS and len(layers) < 10


def case_file(content: bytes) -> bool:
    """Read a case file and sail in it."""
    world = load_world()
    with tempfile.TemporaryDirectory() as folder, in_time():
        path = Path(folder) / "mine.yaml"
        path.write_bytes(content)
        with leaves_nothing(Path(folder)):
            try:
                case = load_case(str(path), world)
            except ConfigError as error:
                whole = str(error)
                if not whole.startswith(f"{path}: not readable as YAML: ") and f"{path}: must " not in whole:
                    refusal(error, "case", content.decode(errors="replace"), f"{path}: ")
                return False
            sail(case, world)
    return True


def command(given: commands.Command) -> bool:
    """Give a command in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        commands.prepare(Path(folder))
        return commands.attempt(given, Path(folder))


KINDS = {
    "overrides": Kind(lines.overrides(), overrides),
    "study overrides": Kind(lines.study_lines, study),
    "configurations": Kind(
        sampled_from(["any"]).flatmap(lambda _: trees.damaged(OmegaConf.to_container(base(), resolve=True))),
        configuration,
    ),
    "worlds": Kind(settings.worlds().map(lambda world: {"world": world}), configuration),
    "networks": Kind(settings.networks().map(lambda network: {"network": network}), configuration),
    "learners": Kind(
        settings.learners().map(lambda learner: {"learn": learner, "network": SMALL_NETWORK}), configuration
    ),
    "case files": Kind(case_files.case_texts().map(lambda t: t.encode("utf-8", "surrogatepass")), case_file),
    "files that are no case": Kind(case_files.bytes_of_files, case_file),
    **{
        f"{name} files": Kind(readers.contents(name), partial(readers.read, name))
        for name in list(readers.READERS)[1:]
    },
}
