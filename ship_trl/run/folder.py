"""The folder of a run: check its contents before the run begins, and empty it. No torch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from omegaconf import OmegaConf
from yaml import YAMLError

from ship_trl.config.checks import check_world
from ship_trl.config.errors import ConfigError, one_line
from ship_trl.config.schema import read_as
from ship_trl.config.types import Perturbation, World, plain
from ship_trl.files.curve import RunError
from ship_trl.files.disk import atomic_write, remove
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.files.untrusted import read_yaml
from ship_trl.run.checkpoint import FOLDER, read_hashes
from ship_trl.transfer.casebase import CONFIG

if TYPE_CHECKING:
    from ship_trl.run.plan import Run

# Settings that do not change what a run learns.
IGNORED_KEYS = {
    *("output", "case_base", "overwrite", "logger", "wandb", "checkpoint", "objective", "pair", "profile"),
    "fast",
}
MAX_DIFFERENCES_SHOWN = 3


class TakenError(ConfigError):
    """The folder holds a run of other settings, or a damaged result.

    Both arguments are kept, so that a process of a grid can pickle the error for its launcher.
    """

    def __init__(self, folder: Path, held: str) -> None:
        super().__init__(folder, held)
        self.folder, self.held = folder, held

    def __str__(self) -> str:
        return one_line(
            f"output: {self.folder} holds {self.held}; "
            "allowed: another output=FOLDER, or overwrite=true to replace it"
        )


def check_folder(run: Run) -> None:
    """Check, before a run begins, that its folder is writable and that no other run would be overwritten."""
    parent = next(folder for folder in (run.folder, *run.folder.parents) if folder.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise ConfigError(f"output: {parent} is not a folder that can be written")
    find_result(run)


def find_result(run: Run) -> RunRecord | None:
    """Return the run's result if its folder holds it, or None if the run may be trained there.

    With `overwrite=true`, it may also be trained in a folder of another run or of a damaged result.

    Raises:
        TakenError: the folder holds a run of other settings, finished or not, or a damaged result.
    """
    held = ""
    if (run.folder / RESULT).exists():
        try:
            result = read_run(run.folder)
            if result.config_hash == run.config_hash:
                return result
            held = f"a finished run of other settings{list_differences(run)}"
        except RunError as error:
            held = f"a damaged result: {error}"
    elif (hashes := read_hashes(run.folder)) and run.config_hash not in hashes:
        differences = list_differences(run)
        # Without a readable checkpoint, the folder may hold this run or another.
        if differences or any(hashes):
            held = f"an unfinished run of other settings{differences}"
    if held and not run.config.overwrite:
        raise TakenError(run.folder, held)
    return None


def list_differences(run: Run) -> str:
    """List the first settings that differ in the run's folder, such as ` (learn.lr=0.001)`; may be empty."""
    try:
        there = OmegaConf.to_container(read_yaml(run.folder / CONFIG))
    except (OSError, yaml.YAMLError):
        return ""
    ours = dict(flatten(plain(run.config)))
    found = [f"{key}={value}" for key, value in flatten(there) if key in ours and ours[key] != value]
    return f" ({', '.join(found[:MAX_DIFFERENCES_SHOWN])})" if found else ""


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

    It deletes an unfinished run, or a run that `overwrite=true` replaces. With `resume` it keeps the
    checkpoints, because everything else is written again.
    """
    try:
        run.folder.mkdir(parents=True, exist_ok=True)
        for path in run.folder.iterdir():
            if path.name != FOLDER or not resume:
                remove(path)
        with atomic_write(run.folder / CONFIG) as draft:
            OmegaConf.save(OmegaConf.structured(run.config), draft)
        # The checkpoint folder exists until the run is finished.
        (run.folder / FOLDER).mkdir(exist_ok=True)
    except OSError as error:
        place = error.filename or run.folder
        raise ConfigError(f"output: {place} cannot be written: {error.strerror}") from None


def read_settings(folder: Path) -> tuple[World, bool, Perturbation]:
    """Read a run's world, whether its pictures have colours, and its perturbation from its configuration."""
    path = folder / CONFIG
    try:
        values: Any = read_yaml(path)
        world = read_as(World, values.world, key="world")
        check_world(world)
        perturbation = read_as(Perturbation, values.get("perturbation") or {}, key="perturbation")
        return world, bool(values.colour), perturbation
    except ConfigError as error:
        raise ConfigError(f"policy: {path}: {error}") from None
    except (OSError, AttributeError, ValueError, YAMLError) as error:
        raise ConfigError(f"policy: {path} is not a configuration: {' '.join(str(error).split())}") from None
