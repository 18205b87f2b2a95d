"""Check the runs of a grid before the first one starts: each is valid and has its own folder."""

from __future__ import annotations

import copy
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.paths import conf_dir
from ship_trl.run.launchers import check_slurm
from ship_trl.run.plan import TakenError, make_run

Words = Sequence[str]


class CheckRuns(Callback):
    """Refuses a grid, in one line, if a run is invalid or two runs would share a folder."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check before Hydra writes anything and before the launcher starts."""
        try:
            check(config)
        except ConfigError as error:
            print_error(str(error))
            # Hydra turns exceptions of a callback into warnings.
            sys.exit(1)


def check(config: DictConfig) -> None:
    """Compose and check every run.

    Raises:
        ConfigError: a run is invalid, two different runs share a folder, or there is no cluster.
    """
    check_slurm(str(config.hydra.runtime.choices["hydra/launcher"]), "hydra/launcher")
    kept: dict[Path, dict[str, set[str]]] = {}
    for number, words in enumerate(runs_of(config)):
        try:
            run = make_run(to_config(composed(config, number, words)))
        except TakenError:
            # This run is refused when its turn comes; the others are trained.
            continue
        except (HydraException, OmegaConfBaseException):
            # Hydra itself reports what is wrong.
            return
        kept.setdefault(run.folder, {})[run.config_hash] = set(words)
    for folder, runs in kept.items():
        if len(runs) > 1:
            every = [word for words in runs.values() for word in words]
            differ = {word for word in every if every.count(word) < len(runs)}
            raise ConfigError(
                describe_shared(folder, sorted({word.split("=")[0].lstrip("+") for word in differ}))
            )


def describe_shared(folder: Path, keys: Sequence[str]) -> str:
    """Say that runs which differ in `keys` share a folder, and how each gets its own."""
    groups = {path.name for path in conf_dir().iterdir() if path.is_dir()}
    each = f"as 'output=outputs/{'-'.join(f'${{{key}}}' for key in keys)}'"
    if groups & set(keys):
        # These keys choose config groups, which the name of the output folder cannot contain.
        each = "by a grid for each with another output=FOLDER"
    return (
        f"output: runs that differ in {' and '.join(keys)} would all be {folder}; allowed: one each, {each}"
    )


def runs_of(config: DictConfig) -> list[Words]:
    """List the overrides of each run of a grid; empty if a sweeper chooses them one after another."""
    sweeper = config.hydra.sweeper
    if not str(sweeper.get("_target_")).endswith(BasicSweeper.__name__):
        return []
    params = sweeper.get("params") or {}
    # Unresolved: ${learn.lr} has another value in each run.
    task: Any = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    words = [*(f"{key}={value}" for key, value in params.items()), *task]
    try:
        given = OverridesParser.create().parse_overrides(words)
    except HydraException:
        return []
    return [run for batch in BasicSweeper.split_arguments(given, None) for run in batch]


def composed(config: DictConfig, number: int, words: Words) -> DictConfig:
    """Compose a run of a grid as the launcher will."""
    values = GlobalHydra.instance().config_loader().load_sweep_config(config, list(words))
    with read_write(values), open_dict(values):
        values.hydra.job.num = number
    known = HydraConfig.instance()
    before, known.cfg = known.cfg, None
    try:
        known.set_config(values)
        task = copy.deepcopy(values)
        with read_write(task), open_dict(task):
            del task["hydra"]
        OmegaConf.resolve(task)
        return task
    finally:
        known.cfg = before
