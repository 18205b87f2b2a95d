"""Restore a study's folder from its tables, so that the study can go on. No torch."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import write_curve
from ship_trl.files.result import write_result
from ship_trl.study.plan.manifest import PLAN
from ship_trl.study.records.tables import KEPT, place_of, read_tables


def restore(copy: Path, folder: Path) -> tuple[int, list[int]]:
    """Write a study's folder with the complete seeds of its tables.

    Other seeds are trained anew as a whole: their missing runs would need networks that no longer exist.

    Returns:
        The number of restored runs, and the seeds that are not complete.

    Raises:
        ConfigError: the tables cannot be read, no seed is complete, or the folder is not empty.
    """
    plan, runs = read_tables(copy, "copy")
    planned = {(job["part"], job["label"], job["arm"], job["seed"]) for job in plan["jobs"]}
    have = {(record.part, record.pair, record.arm.name, record.seed) for record, _, _ in runs}
    seeds = {seed for *_, seed in planned}
    complete = seeds - {seed for *_, seed in planned - have}
    restored = [run for run in runs if run[0].seed in complete]
    if not complete:
        raise ConfigError(f"copy: {copy} has no seed with all its runs; start a new study instead")
    folder = folder.resolve()
    draft = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"folder: {folder} is there already; allowed: a new one")
        draft.mkdir(parents=True)
        for record, result, rows in restored:
            place = draft / place_of(record.part, result)
            place.mkdir(parents=True)
            write_curve(place, rows)
            write_result(place, result)
        del plan[KEPT]
        (draft / PLAN).write_text(json.dumps(plan, indent=1))
        draft.rename(folder)
    except OSError as error:
        raise ConfigError(f"folder: {error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return len(restored), sorted(({seed for *_, seed in have} | seeds) - complete)
