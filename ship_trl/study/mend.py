"""Finished runs that cannot be read any more: set aside, so that they are trained again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ship_trl.config import ConfigError
from ship_trl.plan import DAMAGED, RESULT
from ship_trl.study.config import StudyConfig
from ship_trl.study.plan import Job
from ship_trl.study.records import BrokenRunError, read_placed


def set_aside(jobs: list[Job], config: StudyConfig) -> Iterator[str]:
    """Rename the folder of each damaged run, and say so; nothing is deleted.

    A run without a result was stopped, not damaged: it begins anew in its folder.

    Raises:
        ConfigError: a folder that cannot be renamed.
    """
    for job in jobs:
        folder = job.folder(config.folder)
        if not (folder / RESULT).exists():
            continue
        try:
            read_placed(folder)
        except BrokenRunError as error:
            aside = free_name(folder)
            try:
                folder.rename(aside)
            except OSError as problem:
                raise ConfigError(f"output: {folder} cannot be set aside: {problem.strerror}") from None
            yield f"{folder}: {error}; kept as {aside.name} and trained again"


def free_name(folder: Path) -> Path:
    """`damaged-1-seed=0` beside `seed=0`, or the next number that is free."""
    number = 1
    while (aside := folder.with_name(f"{DAMAGED}{number}-{folder.name}")).exists():
        number += 1
    return aside
