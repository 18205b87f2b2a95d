"""Runs a study's jobs with Hydra's launchers, each stage a multirun, and renames damaged runs before."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from ship_trl.config.command import override
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Logger, plain
from ship_trl.files.disk import atomic_write, links
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.grid.launchers import die_with_parent
from ship_trl.run.checkpoint import FOLDER as CHECKPOINTS
from ship_trl.run.plan import DAMAGED
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import PARTS, Job, source_folder
from ship_trl.study.plan.manifest import run_config
from ship_trl.study.records.record import BrokenRunError, read_placed
from ship_trl.transfer.casebase import POLICY

LOG, JOBS, CASE_BASE = "log.txt", "jobs", "case_base"
# Keys that all runs of a study share, beside "learn".
SHARED_KEYS = ("profile", "device", "fast", "colour", "world", "network", "algorithm")


def write_jobs(jobs: list[Job], config: StudyConfig) -> None:
    """Write a file for each job, `<study>/jobs/job/NAME.yaml`.

    `python -m ship_trl --config-dir <study>/jobs +job=NAME` runs a job alone. The file holds all settings of
    the study, so the run writes the same files as in the study.

    Raises:
        ConfigError: a path of the study that would be written or renamed is a link.
    """
    folder = config.folder / JOBS / "job"
    shared_paths = (folder, *(config.folder / name for name in (LOG, CASE_BASE, *PARTS)))
    for place in (*shared_paths, *(job.folder(config.folder) for job in jobs)):
        if linked := links(place, config.folder):
            raise ConfigError(f"output: {linked[0]} is a link; allowed: only output= itself may be one")
    whole = plain(run_config(config))
    shared, learn = {key: whole[key] for key in SHARED_KEYS}, whole["learn"]
    folder.mkdir(parents=True, exist_ok=True)
    # Absolute, because the processes of a cluster node start in another folder.
    study = config.folder.absolute()
    for job in jobs:
        values: dict[str, Any] = shared | job.values | {"learn": learn | job.values.get("learn", {})}
        values |= {
            "output": str(study / job.part),
            "case_base": str(study / CASE_BASE),
            "wandb": {"folder": str(study), "group": f"{job.part}/{job.label}"},
        }
        with atomic_write(folder / f"{job.name}.yaml") as draft:
            draft.write_text("# @package _global_\n" + OmegaConf.to_yaml(values))


def finished(job: Job, config: StudyConfig) -> Result | None:
    """Return the result of a finished job; None without a result, or with checkpoints left."""
    folder = job.folder(config.folder)
    try:
        found = read_result(folder)
    except ResultError:
        return None
    is_done = (found.arm, found.seed) == (job.arm, job.seed) and not (folder / CHECKPOINTS).exists()
    return found if is_done else None


def unfinished(jobs: list[Job], config: StudyConfig) -> list[Job]:
    """Return the jobs that are not finished."""
    return [job for job in jobs if finished(job, config) is None]


def command(jobs: list[Job], config: StudyConfig) -> list[str]:
    """Return the command of a multirun of these jobs."""
    wandb = config.wandb if config.logger.includes(Logger.wandb) else None
    return [
        *(sys.executable, "-m", "ship_trl", "--multirun"),
        *("--config-dir", str((config.folder / JOBS).absolute())),
        *(f"hydra/launcher={config.launcher}", override("hydra.sweep.dir", config.folder.absolute())),
        # The runs were checked when they were planned.
        "~hydra.callbacks.check_runs",
        *([f"hydra.launcher.n_jobs={config.processes}"] if config.processes else []),
        *(f"profile={config.profile}", f"logger={config.logger.name}"),
        *([override("wandb.project", wandb.project), f"wandb.mode={wandb.mode.name}"] if wandb else []),
        *([override("wandb.entity", wandb.entity)] if wandb and wandb.entity else []),
        *config.overrides,
        f"+job={','.join(job.name for job in jobs)}",
    ]


@contextmanager
def started(arguments: list[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a child process that appends its output to `log`; terminate it at the end of the block."""
    with log.open("ab") as output:
        child = subprocess.Popen(
            arguments,
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            preexec_fn=die_with_parent,
        )
        try:
            yield child
        finally:
            child.terminate()
            child.wait()


def run_jobs(jobs: list[Job], config: StudyConfig, watch: Callable[[], None]) -> list[Job]:
    """Run jobs stage by stage, with retries, and return those without a result; call `watch` every second.

    Some launchers stop all runs when one process dies. So only a round that finishes no run is a failure.
    """
    for stage in sorted({job.stage for job in jobs}):
        # Without the study's source a run would train its own.
        left, failures = [job for job in jobs if job.stage == stage and has_source(job, config)], 0
        while left and failures <= config.retries:
            for batch in batches(left, config):
                with started(command(batch, config), config.folder / LOG) as child:
                    while child.poll() is None:
                        watch()
                        with suppress(subprocess.TimeoutExpired):
                            child.wait(1.0)
                watch()
            before, left = left, unfinished(left, config)
            failures += len(left) == len(before)
    return unfinished(jobs, config)


def has_source(job: Job, config: StudyConfig) -> bool:
    """Return whether a job needs no source, or its source is finished."""
    source = source_folder(job, config)
    return source is None or (config.folder / source / RESULT).exists()


def batches(jobs: list[Job], config: StudyConfig) -> list[list[Job]]:
    """Split jobs into batches; slurm_local starts a whole batch in parallel, so it gets one job a process."""
    size = processes(config) if config.launcher == "slurm_local" else len(jobs)
    return [jobs[k : k + size] for k in range(0, len(jobs), size)]


def processes(config: StudyConfig) -> int:
    """Return how many runs are in parallel on this machine; by default one a core."""
    if config.processes is not None:
        return config.processes
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
