"""Hydra's callback of a grid: check the runs before the first one starts; and what a sweep maximises."""

from __future__ import annotations

import os
import secrets
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
from ship_trl.config.errors import ConfigError, command, print_error
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import Objective
from ship_trl.files.curve import RunError
from ship_trl.files.record import RunRecord
from ship_trl.grid.launchers import GRID, check_slurm, install_signal_handlers
from ship_trl.run.console import say
from ship_trl.run.plan import Run, TakenError, make_run

TOKEN, TOKEN_PATH, MODE = "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH", "RAY_AUTH_MODE"


class Grid(Callback):
    """Checks a grid, and lets its processes stop cleanly.

    A study has checked its runs when it planned them, and sets `checks` to false.
    """

    def __init__(self, checks: bool) -> None:
        self._checks = checks
        self._folders: list[Path] = []

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check before Hydra writes anything and before the launcher starts.

        It exits on a wrong run, because Hydra turns exceptions of a callback into warnings.
        """
        try:
            if self._checks:
                self._folders = check(config)
        except ConfigError as error:
            print_error(str(error))
            sys.exit(1)
        install_signal_handlers()
        if count := OmegaConf.select(config.hydra.sweeper, "n_trials") or len(list_runs(config)):
            os.environ[GRID] = str(count)
        launcher = config.hydra.launcher
        if "hydra_ray_launcher" in str(launcher.get("_target_")):
            close_token(own_cluster=OmegaConf.select(launcher, "ray.init.address") in (None, "local"))

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Say how to compare the runs; a failed run ends the grid before."""
        if len(self._folders) > 1:
            say(f"compare the runs: {command('results', os.path.commonpath(self._folders))}")


def check(config: DictConfig) -> list[Path]:
    """Compose and check every run; return the folders of those to be trained.

    Raises:
        ConfigError: a run is invalid, two different runs share a folder, a key is given twice, or there is no
            cluster.
    """
    check_repeated(OmegaConf.to_container(config.hydra.overrides.task, resolve=False))
    check_slurm(str(config.hydra.runtime.choices["hydra/launcher"]), "hydra/launcher")
    in_folder: dict[Path, dict[str, set[str]]] = {}
    for number, words in enumerate(list_runs(config)):
        try:
            run = make_run(to_config(compose_run(config, number, words)))
        except TakenError:
            # This run fails when its turn comes; the other runs are trained.
            continue
        except (HydraException, OmegaConfBaseException):
            # Hydra reports this error itself.
            return []
        in_folder.setdefault(run.folder, {})[run.config_hash] = set(words)
    for folder, runs in in_folder.items():
        if len(runs) > 1:
            every = list(runs.values())
            differ = every[0].union(*every) - every[0].intersection(*every)
            keys = sorted({word.split("=")[0].lstrip("+") for word in differ})
            how = "a grid for each value, with its own output=FOLDER"
            if not any((conf_dir() / key).is_dir() for key in keys):  # a group has no name in a folder's name
                how = f"'output=outputs/{'-'.join(f'${{{key}}}' for key in keys)}', or {how}"
            raise ConfigError(
                f"output: runs that differ in {' and '.join(keys)} would share {folder}; allowed: {how}"
            )
    return [*in_folder]


def check_repeated(words: Any) -> None:
    """Refuse a key that is given twice: Hydra would take the last one, and drop the values of a grid."""
    keys = [word.partition("=")[0].lstrip("+") for word in words]
    for key in keys:
        if keys.count(key) > 1:
            raise ConfigError(f"{key}: given twice; allowed: once in a grid")


def list_runs(config: DictConfig) -> list[Sequence[str]]:
    """List the overrides of each run of a grid; empty if a sweeper chooses them during the sweep."""
    if not str(config.hydra.sweeper.get("_target_")).endswith(BasicSweeper.__name__):
        return []
    params = config.hydra.sweeper.get("params") or {}
    # Unresolved, because ${learn.lr} may have another value in each run.
    task: Any = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    words = [*(f"{key}={value}" for key, value in params.items()), *task]
    try:
        given = OverridesParser.create().parse_overrides(words)
        return [run for batch in BasicSweeper.split_arguments(given, None) for run in batch]
    except HydraException:  # Hydra reports this error itself
        return []


def compose_run(config: DictConfig, number: int, words: Sequence[str]) -> DictConfig:
    """Compose the configuration of a run of a grid, as the launcher will do."""
    values = GlobalHydra.instance().config_loader().load_sweep_config(config, list(words))
    with read_write(values), open_dict(values):
        values.hydra.job.num = number
    known = HydraConfig.instance()
    before, known.cfg = known.cfg, None
    try:
        known.set_config(values)
        task = OmegaConf.masked_copy(values, [str(key) for key in values if key != "hydra"])
        OmegaConf.resolve(task)
        return task
    finally:
        known.cfg = before


def close_token(own_cluster: bool) -> None:
    """Hide Ray's token from other users of the machine.

    If Ray starts a cluster, it writes the cluster's token into `~/.ray/auth_token`, which everyone can read.
    The cluster ends with the grid, so the token of our own one stays in memory. A file is made private.
    """
    path = Path.home() / ".ray" / "auth_token"
    if path.is_file() and path.stat().st_mode & 0o077:
        path.chmod(0o600)
    elif own_cluster and not path.exists() and not {TOKEN, TOKEN_PATH} & os.environ.keys():
        os.environ.setdefault(MODE, "token")
        os.environ[TOKEN] = secrets.token_hex(32)


def objective(run: Run, result: RunRecord) -> float:
    """Return the greedy return that the setting `objective` chooses."""
    if run.config.objective is Objective.best:
        return result.best.episode_return
    if run.config.objective is Objective.final:
        return result.final.episode_return
    try:
        greedy = result.greedy
    except RunError as error:
        raise ConfigError(
            f"objective: {run.folder}: {error}; allowed without a curve: objective=final, objective=best"
        ) from None
    explored = run.config.learn.epsilon_fraction * run.config.learn.episodes
    # Never empty, because a run ends with an evaluation.
    return float(greedy.returns[greedy.episode >= explored].mean())
