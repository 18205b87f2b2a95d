"""Check the runs of a grid before the first one starts: each is valid and has its own folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.grid.launchers import check_slurm, exit_with, list_runs
from ship_trl.run.plan import TakenError, make_run


class CheckRuns(Callback):
    """Ends the program with a one-line message if a run is invalid or two runs would share a folder."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check before Hydra writes anything and before the launcher starts."""
        try:
            check(config)
        except ConfigError as error:
            exit_with(str(error))


def check(config: DictConfig) -> None:
    """Compose and check every run.

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
            return
        in_folder.setdefault(run.folder, {})[run.config_hash] = set(words)
    for folder, runs in in_folder.items():
        if len(runs) > 1:
            every = list(runs.values())
            differ = every[0].union(*every) - every[0].intersection(*every)
            keys = sorted({word.split("=")[0].lstrip("+") for word in differ})
            raise ConfigError(describe_shared(folder, keys))


def check_repeated(words: Any) -> None:
    """Refuse a key that is given twice: Hydra would take the last one, and drop the values of a grid."""
    given: dict[str, str] = {}
    for word in words:
        key = word.partition("=")[0].lstrip("+")
        if key in given:
            raise ConfigError(f"{key}: given twice, as {given[key]} and {word}; allowed: once in a grid")
        given[key] = word


def describe_shared(folder: Path, keys: Sequence[str]) -> str:
    """Return the message that runs which differ in `keys` share a folder, and how each run gets its own."""
    groups = {path.name for path in conf_dir().iterdir() if path.is_dir()}
    how = f"'output=outputs/{'-'.join(f'${{{key}}}' for key in keys)}'"
    if groups & set(keys):
        # These keys choose config groups. The name of the output folder cannot contain them.
        how = "a grid for each value, with its own output=FOLDER"
    return f"output: runs that differ in {' and '.join(keys)} would share {folder}; allowed: {how}"


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
