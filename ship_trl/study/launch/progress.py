"""Estimates how long a study takes, and shows its progress: a bar in a terminal, else lines."""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from ship_trl.config.command import override
from ship_trl.config.errors import ConfigError
from ship_trl.files.curve import CURVE
from ship_trl.files.result import RESULT, read_result
from ship_trl.run.progress import Lines
from ship_trl.study.launch.launch import finished, processes, started, unfinished
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import Job

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
        )
        done = len(jobs) - len(self._left)
        self._task = self._bar.add_task("", total=len(jobs), completed=done, done=done, now="")
        share = (done + sum(map(self._share, self._left))) / len(jobs)
        self._lines = Lines(LINE_SHARE, first=share, begun=share, apart=LINE_SECONDS)

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
        if not console.is_terminal and (left := self._lines.due(share)) is not None:
            say(f"{done} of {total} runs done, {share:.0%} of all{left}; now {now or 'starting'}")

    def _share(self, job: Job) -> float:
        """Return the share of a run's episodes that are done."""
        return last_episode(job.folder(self._config.folder) / CURVE) / self._episodes


def last_episode(path: Path) -> int:
    """Return the episode in the last whole line of a curve; 0 if there is none."""
    if not path.is_file():  # to open a pipe would wait for ever
        return 0
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
            *("~hydra.callbacks.check_runs", override("output", folder)),
            f"seed={','.join(map(str, range(count)))}",
        ]
        with started(line, log) as child:
            if child.wait() != 0:
                last_line = log.read_text().strip().split("\n")[-1]
                raise ConfigError(f"overrides: short runs failed: {last_line.removeprefix('ship_trl: ')}")
        return statistics.mean(read_result(path.parent).seconds for path in Path(folder).rglob(RESULT))
