"""Runs a study's jobs with Hydra's launchers, each stage a multirun, and shows how far it is."""

from __future__ import annotations

import hashlib
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from rich.console import Console
from rich.progress import BarColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from ship_trl.config.command import override
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import WandbMode, plain, trackers_of
from ship_trl.files.curve import CURVE, RunError
from ship_trl.files.disk import atomic_write
from ship_trl.files.record import RESULT, RunRecord, read_run
from ship_trl.grid.launchers import die_with_parent
from ship_trl.run.console import PACE_SECONDS, Lines, time_left
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
            "wandb": {"folder": str(study), "group": f"{job.part}/{job.label}"},
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


console = Console(highlight=False)
# Bytes that hold the last line of a learning curve.
TAIL_BYTES = 400
# Without a terminal: a line after this share of the study, and at least this many seconds after the last.
LINE_SHARE, LINE_SECONDS = 0.01, 60.0
# From this many finished runs on, the estimate is their mean.
MIN_FINISHED = 4
# Episodes of the two short runs; a line through their times gives the time of a whole run.
SHORT, LONG = 8, 40


def say(text: str) -> None:
    """Print a line."""
    console.print(text, markup=False, soft_wrap=True)


class Display:
    """Shows how much of a study is done; an unfinished run counts by its share of the `episodes` of a run."""

    def __init__(self, jobs: list[Job], config: StudyConfig, episodes: int) -> None:
        self._jobs, self._config, self._episodes = jobs, config, episodes
        self._left = unfinished(jobs, config)
        self._bar = Progress(
            BarColumn(bar_width=30),
            "{task.fields[done]} of {task.total} runs",
            TimeElapsedColumn(),
            "left",
            TimeRemainingColumn(),
            "{task.fields[now]}",
            console=console,
            disable=not console.is_terminal,
            speed_estimate_period=PACE_SECONDS,
        )
        done = len(jobs) - len(self._left)
        self._task = self._bar.add_task("", total=len(jobs), completed=done, done=done, now="")
        share = (done + sum(map(self._share, self._left))) / len(jobs)
        self._lines = Lines(LINE_SHARE, share, LINE_SECONDS)

    def __enter__(self) -> Display:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self) -> None:
        """Read the runs' folders and move the bar, or print a line if one is due."""
        self._left = unfinished(self._left, self._config)
        shares = [self._share(job) for job in self._left]
        done, total = len(self._jobs) - len(self._left), len(self._jobs)
        running = [job for job, share in zip(self._left, shares, strict=True) if share > 0]
        now = ", ".join(f"{job.label} {job.arm} {job.seed}" for job in running[:4])
        completed = done + sum(shares)
        self._bar.update(self._task, completed=completed, done=done, now=now)
        share = completed / total
        if not console.is_terminal and self._lines.due(share):
            left = time_left(self._bar)
            say(f"{done} of {total} runs done, {share:.0%} of all{left}; now {now or 'starting'}")

    def _share(self, job: Job) -> float:
        """Return the share of a run's episodes that are done."""
        return last_episode(job.folder(self._config.folder) / CURVE) / self._episodes


def last_episode(path: Path) -> int:
    """Return the episode in the last whole line of a curve; 0 if there is none."""
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - TAIL_BYTES))
            return int(file.read().split(b"\n")[-2].split(b",")[0])
    except (OSError, ValueError, IndexError):
        return 0


def seconds_per_run(jobs: list[Job], config: StudyConfig, episodes: int) -> tuple[float, str]:
    """Return the seconds of a run while others run beside it, and what the estimate is based on."""
    known = [result.seconds for result in (finished(job, config) for job in jobs) if result]
    if len(known) >= MIN_FINISHED:
        return statistics.mean(known), f"the {len(known)} finished runs"
    if episodes <= LONG:
        return time_runs(config, episodes), f"runs of {episodes} episodes"
    # The first run of a fresh installation compiles kernels.
    time_runs(config, 1)
    short, long = time_runs(config, SHORT), time_runs(config, LONG)
    per_episode = max(0.0, (long - short) / (LONG - SHORT))
    return short + per_episode * (episodes - SHORT), f"runs of {SHORT} and {LONG} episodes"


def time_runs(config: StudyConfig, episodes: int) -> float:
    """Return the mean seconds of short runs from scratch, as many in parallel as in the study.

    Raises:
        ConfigError: the runs failed.
    """
    count = processes(config)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.txt"
        # The last of a key that is given twice counts; a check of the grid would refuse it.
        line = [
            *(sys.executable, "-m", "ship_trl", "--multirun", f"hydra.launcher.n_jobs={count}"),
            *(override("hydra.sweep.dir", folder), f"profile={config.profile}", *config.run_overrides),
            *("target=4", "method=scratch", f"learn.episodes={episodes}", "learn.warmup_steps=100"),
            *("hydra.callbacks.grid.checks=false", override("output", folder)),
            f"seed={','.join(map(str, range(count)))}",
        ]
        with started(line, log) as child:
            if child.wait() != 0:
                last_line = log.read_text().strip().split("\n")[-1]
                raise ConfigError(f"overrides: short runs failed: {last_line.removeprefix('ship_trl: ')}")
        return statistics.mean(read_run(path.parent).seconds for path in Path(folder).rglob(RESULT))


REPORT = "report"
TABLES = ("claims", "arms", "table_2")


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
            logged[name] = wandb.Table(dataframe=pd.read_csv(path))
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
            group=REPORT,
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
