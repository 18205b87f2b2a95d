"""Runs a study's jobs through Hydra's launchers: each a file, each stage one multirun."""

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
from ship_trl.files.disk import links, replacing
from ship_trl.files.result import RESULT, Result, ResultError, read_result
from ship_trl.run.checkpoint import FOLDER as CHECKPOINTS
from ship_trl.run.launchers import die_with_parent
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import PARTS, Job, source_of
from ship_trl.study.plan.manifest import run_config

LOG, JOBS, BASE = "log.txt", "jobs", "case_base"
# What all runs of a study have in common, beside the learner.
SHARED = ("profile", "device", "colour", "world", "network")


def write_jobs(jobs: list[Job], config: StudyConfig) -> None:
    """Write a file for each job, `<study>/jobs/job/NAME.yaml`.

    `python -m ship_trl --config-dir <study>/jobs +job=NAME` runs it alone: with all that the study
    has set, so that what it leaves in the study's folder is what the study would have left.

    Raises:
        ConfigError: something of the study's folder that would be written, or renamed, is a link.
    """
    folder = config.folder / JOBS / "job"
    own = (folder, *(config.folder / name for name in (LOG, BASE, *PARTS)))
    for place in (*own, *(job.folder(config.folder) for job in jobs)):
        if linked := links(place, config.folder):
            raise ConfigError(f"output: {linked[0]} is a link; allowed: only output= itself may be one")
    whole = plain(run_config(config))
    shared, learn = {key: whole[key] for key in SHARED}, whole["learn"]
    folder.mkdir(parents=True, exist_ok=True)
    # Absolute, because a node of a cluster starts its processes wherever it likes.
    study = config.folder.absolute()
    for job in jobs:
        values: dict[str, Any] = shared | job.values | {"learn": learn | job.values.get("learn", {})}
        values |= {
            "output": str(study / job.part),
            "case_base": str(study / BASE),
            "wandb": {"folder": str(study), "group": f"{job.part}/{job.label}"},
        }
        with replacing(folder / f"{job.name}.yaml") as draft:
            draft.write_text("# @package _global_\n" + yaml.safe_dump(values, sort_keys=False))


def finished(job: Job, config: StudyConfig) -> Result | None:
    """Give the result of a job that is done, or None; with a checkpoint left, something is to do."""
    folder = job.folder(config.folder)
    try:
        found = read_result(folder)
    except ResultError:
        return None
    if (folder / CHECKPOINTS).exists():
        return None
    return found if (found.arm, found.seed) == (job.arm, job.seed) else None


def command(jobs: list[Job], config: StudyConfig) -> list[str]:
    """Make the multirun of these jobs."""
    # Quoted: a path may hold what Hydra's grammar takes for its own.
    sweep = str(config.folder.absolute()).replace("'", "\\'")
    return [
        *(sys.executable, "-m", "ship_trl", "--multirun"),
        *("--config-dir", str((config.folder / JOBS).absolute())),
        *(f"hydra/launcher={config.launcher}", f"hydra.sweep.dir='{sweep}'"),
        # They were checked when they were planned.
        "~hydra.callbacks.check_runs",
        *([f"hydra.launcher.n_jobs={config.processes}"] if config.processes else []),
        f"profile={config.profile}",
        *logging(config),
        *config.overrides,
        f"+job={','.join(job.name for job in jobs)}",
    ]


def logging(config: StudyConfig) -> list[str]:
    """Make the overrides that say where the runs' numbers go, wandb's into the study's project."""
    if not config.logger.includes(Logger.wandb):
        return [f"logger={config.logger.name}"]
    wandb = config.wandb
    entity = [f"wandb.entity={wandb.entity}"] if wandb.entity else []
    project = [f"wandb.project={wandb.project}", f"wandb.mode={wandb.mode.name}", *entity]
    return [f"logger={config.logger.name}", *project]


@contextmanager
def started(arguments: list[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start a child with its words in `log`, and end it when the block is left."""
    with log.open("ab") as words:
        child = subprocess.Popen(
            arguments,
            stdout=words,
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
    """Run what is not finished, stage by stage, with retries; returns what has no result even so.

    Some launchers end with the first process that dies, and leave the other runs to be started again:
    only a round that finished no run at all is a failure, and only failures are counted.
    `watch` is called about once a second.
    """
    for stage in sorted({job.stage for job in jobs}):
        # Without its source a run would train one of its own, beside the study's.
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
    """Whether the run that a job begins with is finished, if it begins with one of the study's."""
    origin = source_of(job, config)
    return origin is None or (config.folder / origin / RESULT).exists()


def batches(jobs: list[Job], config: StudyConfig) -> list[list[Job]]:
    """Split what is given to the launcher at once: everything, if the launcher waits for a free core."""
    most = processes(config) if config.launcher == "slurm_local" else len(jobs)
    return [jobs[k : k + most] for k in range(0, len(jobs), most)]


def processes(config: StudyConfig) -> int:
    """How many runs go on at once on this machine: as many as are asked for, else one a core."""
    if config.processes is not None:
        return config.processes
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
