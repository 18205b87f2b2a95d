"""Restores a study's folder from its tables, so that the study can go on. No torch."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import write_curve
from ship_trl.files.result import write_result
from ship_trl.study.plan.manifest import PLAN
from ship_trl.study.records.tables import KEPT, Tables, place_of


def restore(tables: Tables, folder: Path) -> tuple[int, list[int]]:
    """Make a study's folder of the complete seeds.

    Other seeds are trained anew as a whole: their missing runs would need networks that no longer exist.

    Returns:
        The number of restored runs, and the seeds that are not complete.

    Raises:
        ConfigError: the folder is not empty, no seed is complete, or the tables do not fit each other.
    """
    planned = {(job["part"], job["label"], job["arm"], job["seed"]) for job in tables.plan["jobs"]}
    have = {(part, run.pair, run.arm, run.seed) for part, run in tables.runs}
    seeds = {seed for *_, seed in planned}
    complete = seeds - {seed for *_, seed in planned - have}
    if not complete:
        raise ConfigError(f"copy: {tables.folder} has no seed with all its runs; a study anew does as much")
    folder = folder.resolve()
    draft = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"folder: {folder} is there already; allowed: a new one")
        draft.mkdir(parents=True)
        count = 0
        for record, result, rows in tables.by_run():
            if record.seed in complete:
                place = draft / place_of(record.part, result)
                place.mkdir(parents=True)
                write_curve(place, rows)
                write_result(place, result)
                count += 1
        plan = {key: value for key, value in tables.plan.items() if key != KEPT}
        (draft / PLAN).write_text(json.dumps(plan, indent=1))
        draft.rename(folder)
    except OSError as error:
        raise ConfigError(f"folder: {error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return count, sorted(({seed for *_, seed in have} | seeds) - complete)
