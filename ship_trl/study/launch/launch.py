"""Runs a study's jobs through Hydra's launchers: each job is a file, each stage a multirun."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Logger, plain
from ship_trl.files.disk import atomic_write, links
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.run.checkpoint import FOLDER as CHECKPOINTS
from ship_trl.run.launchers import die_with_parent
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import PARTS, Job, source_folder
from ship_trl.study.plan.manifest import run_config

LOG, JOBS, CASE_BASE = "log.txt", "jobs", "case_base"
# Keys that all runs of a study share, beside "learn".
SHARED_KEYS = ("profile", "device", "colour", "world", "network")


def write_jobs(jobs: list[Job], config: StudyConfig) -> None:
    """Write a file for each job, `<study>/jobs/job/NAME.yaml`.

    `python -m ship_trl --config-dir <study>/jobs +job=NAME` runs a job alone. The file holds all settings of
    the study, so the run alone leaves the same files as the study would.

    Raises:
        ConfigError: a path of the study that would be written or renamed is a link.
    """
    folder = config.folder / JOBS / "job"
    own = (folder, *(config.folder / name for name in (LOG, CASE_BASE, *PARTS)))
    for place in (*own, *(job.folder(config.folder) for job in jobs)):
        if linked := links(place, config.folder):
            raise ConfigError(f"output: {linked[0]} is a link; allowed: only output= itself may be one")
    whole = plain(run_config(config))
    shared, learn = {key: whole[key] for key in SHARED_KEYS}, whole["learn"]
    folder.mkdir(parents=True, exist_ok=True)
    # Absolute, because a cluster node starts its processes in a folder of its own.
    study = config.folder.absolute()
    for job in jobs:
        values: dict[str, Any] = shared | job.values | {"learn": learn | job.values.get("learn", {})}
        values |= {
            "output": str(study / job.part),
            "case_base": str(study / CASE_BASE),
            "wandb": {"folder": str(study), "group": f"{job.part}/{job.label}"},
        }
        with atomic_write(folder / f"{job.name}.yaml") as draft:
            draft.write_text("# @package _global_\n" + yaml.safe_dump(values, sort_keys=False))


def finished(job: Job, config: StudyConfig) -> Result | None:
    """Return the result of a finished job; None while there is no result, or a checkpoint is left."""
    folder = job.folder(config.folder)
    try:
        found = read_result(folder)
    except ResultError:
        return None
    if (folder / CHECKPOINTS).exists():
        return None
    return found if (found.arm, found.seed) == (job.arm, job.seed) else None


def command(jobs: list[Job], config: StudyConfig) -> list[str]:
    """Return the command of a multirun of these jobs."""
    # Quoted, because a path may hold characters of Hydra's grammar.
    sweep = str(config.folder.absolute()).replace("'", "\\'")
    return [
        *(sys.executable, "-m", "ship_trl", "--multirun"),
        *("--config-dir", str((config.folder / JOBS).absolute())),
        *(f"hydra/launcher={config.launcher}", f"hydra.sweep.dir='{sweep}'"),
        # The runs were checked when they were planned.
        "~hydra.callbacks.check_runs",
        *([f"hydra.launcher.n_jobs={config.processes}"] if config.processes else []),
        f"profile={config.profile}",
        *logging_overrides(config),
        *config.overrides,
        f"+job={','.join(job.name for job in jobs)}",
    ]


def logging_overrides(config: StudyConfig) -> list[str]:
    """Return the overrides that send the runs' numbers to the study's logger."""
    if not config.logger.includes(Logger.wandb):
        return [f"logger={config.logger.name}"]
    wandb = config.wandb
    entity = [f"wandb.entity={wandb.entity}"] if wandb.entity else []
    project = [f"wandb.project={wandb.project}", f"wandb.mode={wandb.mode.name}", *entity]
    return [f"logger={config.logger.name}", *project]


@contextmanager
def started(arguments: list[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a child process with its output appended to `log`; terminate it at the end of the block."""
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
    """Run all unfinished jobs, stage by stage, with retries.

    Some launchers end when one process dies and leave the other runs to be started again. So only a round
    that finishes no run counts as a failure.

    Args:
        jobs: all jobs of the study.
        config: of the study.
        watch: called about once a second.

    Returns:
        The jobs that have no result in the end.
    """
    for stage in sorted({job.stage for job in jobs}):
        # Without the study's source a run would train a source of its own.
        left, failures = [job for job in jobs if job.stage == stage and has_source(job, config)], 0
        while left and failures <= config.retries:
            for batch in batches(left, config):
                with started(command(batch, config), config.folder / LOG) as child:
                    while child.poll() is None:
                        watch()
                        try:
                            child.wait(1.0)
                        except subprocess.TimeoutExpired:
                            continue
                watch()
            before, left = left, [job for job in left if finished(job, config) is None]
            failures += len(left) == len(before)
    return [job for job in jobs if finished(job, config) is None]


def has_source(job: Job, config: StudyConfig) -> bool:
    """Return whether the source of a job is finished, or the job needs none."""
    source = source_folder(job, config)
    return source is None or (config.folder / source / RESULT).exists()


def batches(jobs: list[Job], config: StudyConfig) -> list[list[Job]]:
    """Split jobs into batches: slurm_local starts all jobs of a launch at once, so it gets one a process."""
    most = processes(config) if config.launcher == "slurm_local" else len(jobs)
    return [jobs[k : k + most] for k in range(0, len(jobs), most)]


def processes(config: StudyConfig) -> int:
    """Return how many runs go on at once on this machine; one a core by default."""
    if config.processes is not None:
        return config.processes
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
