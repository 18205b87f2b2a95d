"""Renames damaged runs, so that the study trains them again."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.result import RESULT
from ship_trl.run.plan import DAMAGED
from ship_trl.study.launch.launch import finished
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import Job, source_folder
from ship_trl.study.records.record import BrokenRunError, read_placed
from ship_trl.transfer.casebase import POLICY


def set_aside(jobs: list[Job], config: StudyConfig) -> Iterator[str]:
    """Rename the folder of each damaged run and yield a message; nothing is deleted.

    A run without a result was stopped, not damaged: it resumes. A source without its network counts as
    damaged if an unfinished run needs it.

    Raises:
        ConfigError: a folder cannot be renamed.
    """
    for job in jobs:
        folder = job.folder(config.folder)
        try:
            if (folder / RESULT).exists():
                read_placed(folder)
        except BrokenRunError as error:
            yield rename(folder, str(error))
    # From the last stage to the first: a source that is trained again may need its own source.
    for job in reversed(jobs):
        source = source_folder(job, config)
        if source is None or finished(job, config) is not None:
            continue
        folder = config.folder / source
        # A restored study has no networks, and arms may have been added since.
        if (folder / RESULT).exists() and not (folder / POLICY).exists():
            yield rename(folder, f"{POLICY} is missing, and other runs begin with it")


def rename(folder: Path, reason: str) -> str:
    """Rename a damaged folder to `damaged-1-seed=0`, or the next free number, and return a message."""
    names = (folder.with_name(f"{DAMAGED}{number}-{folder.name}") for number in count(1))
    new = next(name for name in names if not name.exists())
    try:
        folder.rename(new)
    except OSError as error:
        raise ConfigError(f"output: {folder} cannot be set aside: {error.strerror}") from None
    return f"{folder}: {reason}; kept as {new.name} and trained again"
