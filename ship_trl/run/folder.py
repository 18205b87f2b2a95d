"""The folder of a run: what it may hold before the run begins, and how it is made. No torch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from omegaconf import OmegaConf

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config, plain
from ship_trl.files.disk import links, remove, replacing
from ship_trl.files.result import RESULT, ResultError, read_result
from ship_trl.files.untrusted import read_yaml
from ship_trl.run.checkpoint import FOLDER, Checkpoints
from ship_trl.transfer.casebase import CONFIG, LOCKS, CaseBase

if TYPE_CHECKING:
    from ship_trl.run.plan import Run

OTHER_SETTINGS = "of other settings"
# Where a run lies and what it says decide nothing of what is learned.
BESIDE = {"output", "case_base", "overwrite", "logger", "wandb", "checkpoint", "objective", "pair", "profile"}
# So many are named.
MOST = 3


class TakenError(ConfigError):
    """A folder that holds something else: a run of other settings, or a damaged result."""

    def __init__(self, folder: Path, held: str) -> None:
        own = "its settings, " if OTHER_SETTINGS in held else ""
        super().__init__(
            f"output: {folder} holds {held}; "
            f"allowed: {own}another output=FOLDER, or overwrite=true to replace what is there"
        )
        self.folder, self.held = folder, held

    def __reduce__(self) -> tuple[type[TakenError], tuple[Path, str]]:
        """Let a process of a grid send it to the launcher: by itself it would be made of its text alone."""
        return TakenError, (self.folder, self.held)


def check_folder(run: Run) -> None:
    """Refuse a folder that cannot be written or is a link, or where a run would be lost."""
    for parent in (run.folder, *run.folder.parents):
        if parent.exists():
            if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
                raise ConfigError(f"output: {parent} is not a folder that can be written")
            break
    base = CaseBase(Path(run.config.case_base))
    base.refuse_links(run.target, run.entry_arm, run.config.seed, run.config_hash)
    if linked := links(Path(run.config.output) / LOCKS, Path(run.config.output)):
        raise ConfigError(f"output: {linked[0]} is a link; allowed: only output= itself may be one")
    if linked := links(run.folder / FOLDER, Path(run.config.output)):
        raise ConfigError(
            f"output: {linked[0]} is a link, and what it leads to might be replaced; "
            "allowed: only output= itself may be one"
        )
    if run.config.overwrite:
        return
    if not (run.folder / RESULT).exists():
        check_unfinished(run)
        return
    try:
        found = read_result(run.folder)
    except ResultError as error:
        raise TakenError(run.folder, f"a damaged {RESULT} (it {error})") from None
    if found.config_hash != run.config_hash:
        raise TakenError(run.folder, f"a finished run {other_settings(run)}")


def check_unfinished(run: Run) -> None:
    """Refuse a folder with checkpoints of a run of other settings."""
    left = Checkpoints(run.folder)
    unfinished = left.about()
    if unfinished is not None and unfinished.config_hash != run.config_hash:
        reached = f"at episode {unfinished.episode} of {unfinished.episodes}"
        raise TakenError(run.folder, f"an unfinished run {other_settings(run)}, {reached}")
    if unfinished is None and left.of_another(run.config_hash):
        held = f"an unfinished run {other_settings(run)}, whose checkpoints cannot be read"
        raise TakenError(run.folder, held)


def other_settings(run: Run) -> str:
    """Say that a run of a folder has other settings, and which."""
    found = differences(run.folder, run.config)
    return f"{OTHER_SETTINGS} ({', '.join(found)})" if found else OTHER_SETTINGS


def differences(folder: Path, config: Config) -> list[str]:
    """Name the settings that a run's folder has and `config` has not, as `learn.lr=0.001`; at most `MOST`."""
    try:
        there = OmegaConf.to_container(read_yaml(folder / CONFIG))
    except (OSError, yaml.YAMLError):
        return []
    ours = dict(leaves(plain(config)))
    found = [f"{key}={value}" for key, value in leaves(there) if key in ours and ours[key] != value]
    return found[:MOST]


def leaves(values: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Give the single values of a configuration by their dotted keys; a list is one."""
    if not isinstance(values, dict):
        yield place, values
        return
    for key, value in values.items():
        if place or key not in BESIDE:
            yield from leaves(value, f"{place}.{key}" if place else str(key))


def open_folder(run: Run, going_on: bool = False) -> None:
    """Make the run's folder afresh and write its configuration.

    What is there is an unfinished run, or one that `overwrite=true` gives up. Of a run that goes on, its
    checkpoints stay: all else is written again.
    """
    try:
        run.folder.mkdir(parents=True, exist_ok=True)
        for path in run.folder.iterdir():
            if path.name != FOLDER or not going_on:
                remove(path)
        with replacing(run.folder / CONFIG) as draft:
            OmegaConf.save(OmegaConf.structured(run.config), draft)
        # It goes when all is done.
        Checkpoints(run.folder).begin_run(run.config_hash)
    except OSError as error:
        place = error.filename or run.folder
        raise ConfigError(f"output: {place} cannot be written: {error.strerror}") from None
