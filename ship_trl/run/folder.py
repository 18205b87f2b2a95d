"""The folder of a run: check what it holds before the run begins, and empty it. No torch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config, plain
from ship_trl.files.disk import links, remove, replacing
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.files.untrusted import read_yaml
from ship_trl.run.checkpoint import FOLDER, Checkpoints
from ship_trl.run.run import Run
from ship_trl.transfer.casebase import CONFIG, LOCKS, CaseBase

OTHER_SETTINGS = "of other settings"
# Settings that do not change what is learned.
IGNORED_KEYS = {
    *("output", "case_base", "overwrite", "logger", "wandb", "checkpoint", "objective", "pair", "profile")
}
MAX_DIFFERENCES_SHOWN = 3


class TakenError(ConfigError):
    """The folder holds a run of other settings, or a damaged result."""

    def __init__(self, folder: Path, held: str) -> None:
        own = "its settings, " if OTHER_SETTINGS in held else ""
        super().__init__(
            f"output: {folder} holds {held}; "
            f"allowed: {own}another output=FOLDER, or overwrite=true to replace what is there"
        )
        self.folder, self.held = folder, held

    def __reduce__(self) -> tuple[type[TakenError], tuple[Path, str]]:
        """Keep both arguments when a grid process sends the error to its launcher."""
        return TakenError, (self.folder, self.held)


def check_folder(run: Run) -> None:
    """Check, before a run begins, that its folder can be written and that no other run would be lost.

    Raises:
        ConfigError: the folder, a lock or the case base would be written through a link, or not at all.
        TakenError: the folder holds another run.
    """
    for parent in (run.folder, *run.folder.parents):
        if parent.exists():
            if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
                raise ConfigError(f"output: {parent} is not a folder that can be written")
            break
    base, output = CaseBase(Path(run.config.case_base)), Path(run.config.output)
    base.refuse_links(run.target, run.entry_arm, run.config.seed, run.config_hash)
    if linked := links(output / LOCKS, output):
        raise ConfigError(f"output: {linked[0]} is a link; allowed: only output= itself may be one")
    if linked := links(run.folder / FOLDER, output):
        raise ConfigError(
            f"output: {linked[0]} is a link, and what it leads to might be replaced; "
            "allowed: only output= itself may be one"
        )
    find_result(run)


def find_result(run: Run) -> Result | None:
    """Return the run's own result if its folder holds one, and None if it may be trained there.

    With `overwrite=true` a run may be trained wherever there is no result of its own.

    Raises:
        TakenError: the folder holds a run of other settings, finished or not, or a damaged result.
    """
    overwrite = run.config.overwrite
    if not (run.folder / RESULT).exists():
        if not overwrite:
            check_unfinished(run)
        return None
    try:
        result = read_result(run.folder)
    except ResultError as error:
        if overwrite:
            return None
        raise TakenError(run.folder, f"a damaged {RESULT} (it {error})") from None
    if result.config_hash == run.config_hash:
        return result
    if overwrite:
        return None
    raise TakenError(run.folder, f"a finished run {other_settings(run)}")


def check_unfinished(run: Run) -> None:
    """Refuse a folder with checkpoints of a run of other settings."""
    checkpoints = Checkpoints(run.folder)
    unfinished = checkpoints.about()
    if unfinished is not None and unfinished.config_hash != run.config_hash:
        reached = f"at episode {unfinished.episode} of {unfinished.episodes}"
        raise TakenError(run.folder, f"an unfinished run {other_settings(run)}, {reached}")
    if unfinished is None and checkpoints.has_other_owner(run.config_hash):
        held = f"an unfinished run {other_settings(run)}, whose checkpoints cannot be read"
        raise TakenError(run.folder, held)


def other_settings(run: Run) -> str:
    """Say that a folder holds other settings than the run's, and name the first ones that differ."""
    found = differences(run.folder, run.config)
    return f"{OTHER_SETTINGS} ({', '.join(found)})" if found else OTHER_SETTINGS


def differences(folder: Path, config: Config) -> list[str]:
    """Name settings of the run in `folder` that differ from `config`, such as `learn.lr=0.001`."""
    try:
        there = OmegaConf.to_container(read_yaml(folder / CONFIG))
    except (OSError, yaml.YAMLError):
        return []
    ours = dict(flatten(plain(config)))
    found = [f"{key}={value}" for key, value in flatten(there) if key in ours and ours[key] != value]
    return found[:MAX_DIFFERENCES_SHOWN]


def flatten(values: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a nested configuration by their dotted keys; a list is one value."""
    if not isinstance(values, dict):
        yield prefix, values
        return
    for key, value in values.items():
        if prefix or key not in IGNORED_KEYS:
            yield from flatten(value, f"{prefix}.{key}" if prefix else str(key))


def open_folder(run: Run, resume: bool = False) -> None:
    """Empty the run's folder and write its configuration.

    What is deleted is an unfinished run, or one that `overwrite=true` replaces. With `resume` the
    checkpoints stay; everything else is written again.
    """
    try:
        run.folder.mkdir(parents=True, exist_ok=True)
        for path in run.folder.iterdir():
            if path.name != FOLDER or not resume:
                remove(path)
        with replacing(run.folder / CONFIG) as draft:
            OmegaConf.save(OmegaConf.structured(run.config), draft)
        # The folder of the checkpoints exists until the run is finished.
        Checkpoints(run.folder).begin_run(run.config_hash)
    except OSError as error:
        place = error.filename or run.folder
        raise ConfigError(f"output: {place} cannot be written: {error.strerror}") from None
