"""Runs a study's jobs with Hydra's launchers, each stage a multirun, and shows how far it is."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from rich.progress import BarColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from ship_trl.config.errors import ConfigError, override
from ship_trl.config.types import WandbMode, plain, trackers_of
from ship_trl.files.curve import CURVE, RunError
from ship_trl.files.disk import atomic_write
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.grid.launchers import die_with_parent
from ship_trl.run.console import PACE_SECONDS, Lines, console, say, time_left
from ship_trl.run.plan import CHECKPOINTS, DAMAGED
from ship_trl.study.manifest import run_config
from ship_trl.study.plan import Job, StudyConfig, source_folder
from ship_trl.study.tables import read_placed
from ship_trl.transfer.casebase import POLICY

LOG, JOBS, CASE_BASE = "log.txt", "jobs", "case_base"
# Keys that all runs of a study share, beside "learn".
SHARED_KEYS = ("profile", "device", "fast", "colour", "world", "network", "algorithm")


def write_jobs(jobs: list[Job], config: StudyConfig) -> None:
    """Write a file for each job, `<study>/jobs/job/NAME.yaml`.

    `python -m ship_trl --config-dir <study>/jobs +job=NAME` runs a job alone. The file holds all settings of
    the study, so the run writes the same files as in the study.
    """
    folder = config.folder / JOBS / "job"
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
            # A study may have hundreds of runs, and a checkpoint takes more room than the rest of a run.
            "checkpoint": {"keep": False},
            "wandb": {"folder": str(study), "group": study.name},
        }
        with atomic_write(folder / f"{job.name}.yaml") as draft:
            draft.write_text("# @package _global_\n" + OmegaConf.to_yaml(values))


def finished(job: Job, config: StudyConfig) -> RunRecord | None:
    """Return the result of a finished job; None without a result, or with checkpoints left."""
    folder = job.folder(config.folder)
    try:
        found = read_run(folder)
    except RunError:
        return None
    is_done = (found.arm, found.seed) == (job.arm, job.seed) and not (folder / CHECKPOINTS).exists()
    return found if is_done else None


def unfinished(jobs: list[Job], config: StudyConfig) -> list[Job]:
    """Return the jobs that are not finished."""
    return [job for job in jobs if finished(job, config) is None]


def command(jobs: list[Job], config: StudyConfig) -> list[str]:
    """Return the command of a multirun of these jobs."""
    wandb = config.wandb if "wandb" in trackers_of(config.logger) else None
    return [
        *(sys.executable, "-m", "ship_trl", "--multirun"),
        *("--config-dir", str((config.folder / JOBS).absolute())),
        *(f"hydra/launcher={config.launcher}", override("hydra.sweep.dir", config.folder.absolute())),
        # The runs were checked when they were planned.
        "hydra.callbacks.grid.checks=false",
        *([f"hydra.launcher.n_jobs={config.processes}"] if config.processes else []),
        *(f"profile={config.profile}", f"logger={config.logger}"),
        *([override("wandb.project", wandb.project), f"wandb.mode={wandb.mode.name}"] if wandb else []),
        *([override("wandb.entity", wandb.entity)] if wandb and wandb.entity else []),
        *config.overrides,
        f"+job={','.join(job.name for job in jobs)}",
    ]


def run_jobs(jobs: list[Job], config: StudyConfig, watch: Callable[[], None]) -> list[Job]:
    """Run jobs stage by stage, with retries, and return those without a result; call `watch` every second.

    Some launchers stop all runs when one process dies. So only a round that finishes no run is a failure.
    """
    for stage in sorted({job.stage for job in jobs}):
        # Without the study's source a run would train its own.
        left, failures = [job for job in jobs if job.stage == stage and has_source(job, config)], 0
        while left and failures <= config.retries:
            # slurm_local starts all jobs in parallel, so it gets one a process.
            size = processes(config) if config.launcher == "slurm_local" else len(left)
            for k in range(0, len(left), size):
                run_batch(left[k : k + size], config, watch)
            before, left = left, unfinished(left, config)
            failures += len(left) == len(before)
    return unfinished(jobs, config)


def run_batch(jobs: list[Job], config: StudyConfig, watch: Callable[[], None]) -> None:
    """Run jobs in a process of their own, which appends its output to the study's log."""
    with (
        (config.folder / LOG).open("ab") as log,
        subprocess.Popen(
            command(jobs, config),
            stdout=log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            preexec_fn=die_with_parent,
        ) as child,
    ):
        try:
            while child.poll() is None:
                watch()
                with suppress(subprocess.TimeoutExpired):
                    child.wait(1.0)
        finally:
            child.terminate()
            # At Ctrl-C `Popen` would not wait until the runs have written their checkpoints.
            child.wait()
    watch()


def has_source(job: Job, config: StudyConfig) -> bool:
    """Return whether a job needs no source, or its source is finished."""
    source = source_folder(job, config)
    return source is None or (config.folder / source / RESULT).exists()


def processes(config: StudyConfig) -> int:
    """Return how many runs are in parallel on this machine; by default one a core."""
    if config.processes is not None:
        return config.processes
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def set_aside(jobs: list[Job], config: StudyConfig) -> Iterator[str]:
    """Rename the folder of each damaged run and yield a message; nothing is deleted.

    A run without a result was stopped, not damaged: it resumes. A source without its network counts as
    damaged if an unfinished run needs it.
    """
    for job in jobs:
        folder = job.folder(config.folder)
        try:
            if (folder / RESULT).exists():
                read_placed(folder)
        except RunError as error:
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
    folder.rename(new)
    return f"{folder}: {reason}; kept as {new.name} and trained again"


# Bytes that hold the last line of a learning curve.
TAIL_BYTES = 400
# Without a terminal: a line after this share of the study, and at least this many seconds after the last.
LINE_SHARE, LINE_SECONDS = 0.01, 60.0


@contextmanager
def show_progress(jobs: list[Job], config: StudyConfig, episodes: int) -> Iterator[Callable[[], None]]:
    """Yield a function that shows how many runs are done; one under way counts by its share of `episodes`."""
    left, total = unfinished(jobs, config), len(jobs) * episodes

    def done() -> int:
        nonlocal left
        left = unfinished(left, config)
        begun = sum(last_episode(job.folder(config.folder) / CURVE) for job in left)
        return (len(jobs) - len(left)) * episodes + begun

    is_plain, lines = not console.is_terminal, Lines(LINE_SHARE, done() / total, LINE_SECONDS)
    times = TimeElapsedColumn(), "left", TimeRemainingColumn()
    columns = BarColumn(bar_width=30), "{task.description}", *times
    with Progress(*columns, console=console, disable=is_plain, speed_estimate_period=PACE_SECONDS) as bar:
        task = bar.add_task("", total=total, completed=done())

        def watch() -> None:
            completed = done()
            words = f"{len(jobs) - len(left)} of {len(jobs)} runs"
            bar.update(task, completed=completed, description=words)
            if is_plain and lines.due(completed / total):
                say(f"{words} done, {completed / total:.0%} of all{time_left(bar)}")

        yield watch


def last_episode(path: Path) -> int:
    """Return the episode in the last whole line of a curve; 0 if there is none."""
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - TAIL_BYTES))
            return int(file.read().split(b"\n")[-2].split(b",")[0])
    except (OSError, ValueError, IndexError):
        return 0


REPORT = "report"
TABLES = ("claims", "effects", "arms", "table_2")


def check_account(config: StudyConfig) -> None:
    """Check that a user is logged in to wandb before hours of training begin.

    Raises:
        ConfigError: wandb is to be online, and has no key.
    """
    if "wandb" not in trackers_of(config.logger):
        return
    os.environ.setdefault("WANDB_SILENT", "true")
    import wandb

    if config.wandb.mode is WandbMode.online and not wandb.login(prompt=False, verify=False):
        raise ConfigError("wandb: not logged in; run `wandb login`; allowed: wandb.mode=offline")


def log_summary(config: StudyConfig) -> None:
    """Log the report, if the study is logged to wandb.

    Raises:
        ConfigError: wandb refuses.
    """
    if "wandb" not in trackers_of(config.logger):
        return
    import pandas as pd
    import wandb

    folder = config.folder / REPORT
    logged: dict[str, Any] = {png.stem: wandb.Image(str(png)) for png in sorted(folder.glob("*.png"))}
    logged["page"] = wandb.Html(str(folder / "index.html"), inject=False)
    for name in TABLES:
        if (path := folder / f"{name}.csv").exists():
            # A name of its own, because figures and tables share names.
            logged[f"table/{name}"] = wandb.Table(dataframe=pd.read_csv(path))
    verdicts = {}
    if (path := folder / "claims.csv").exists():
        verdicts = pd.read_csv(path).groupby("claim")["claim's verdict"].first().to_dict()
    # A later report of the study replaces this one, because it has the same id.
    digest = hashlib.sha256(str(config.folder.absolute()).encode()).hexdigest()[:12]
    try:
        with wandb.init(
            project=config.wandb.project,
            entity=config.wandb.entity,
            mode="online" if config.wandb.mode is WandbMode.online else "offline",
            dir=str(config.folder),
            group=config.folder.absolute().name,
            job_type=REPORT,
            name=f"report of {config.folder.name}",
            id=f"{REPORT}-{digest}",
            resume="allow",
            tags=[config.profile],
            config={"seeds": list(config.numbers), "pairs": config.pairs, "arms": config.arms},
            reinit="finish_previous",
        ) as run:
            run.log(logged)
            run.summary.update({f"verdict/{name}": verdict for name, verdict in verdicts.items()})
    except (wandb.Error, OSError) as error:
        raise ConfigError(
            f"wandb: {' '.join(str(error).split())}; wandb.mode=offline needs no account"
        ) from None
