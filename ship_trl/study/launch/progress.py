"""How long a study takes on this machine, and how far it is: a bar in a terminal, else lines."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ship_trl.files.result import RESULT, read_result
from ship_trl.run.launchers import die_with_parent
from ship_trl.run.progress import Lines
from ship_trl.study.launch.launch import finished, processes
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import Job

console = Console(highlight=False)
# Bytes that hold the last line of a learning curve.
TAIL_BYTES = 400
# Without a terminal: a line after this share of the study, and at least this many seconds after the last.
LINE_SHARE, LINE_SECONDS = 0.01, 60.0
# From this many finished runs on, their mean is used.
MIN_FINISHED = 4
# Episodes of the two short runs; a line through their times gives the time of a whole run.
SHORT, LONG = 8, 40
CASE = "4"


def say(text: str) -> None:
    """Print a line."""
    console.print(text, markup=False, soft_wrap=True)


class Display:
    """Shows finished runs; a run under way counts by its share of episodes.

    Args:
        jobs: all jobs of the study.
        config: of the study.
        episodes: of one run.
    """

    def __init__(self, jobs: list[Job], config: StudyConfig, episodes: int) -> None:
        self.jobs, self.config, self.episodes = jobs, config, episodes
        self._open = [job for job in jobs if finished(job, config) is None]
        self._bar = Progress(
            BarColumn(bar_width=30),
            TextColumn("{task.fields[done]} of {task.fields[all]} runs"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[now]}"),
            console=console,
            disable=not console.is_terminal,
        )
        done = len(jobs) - len(self._open)
        self._lines: Lines | None = None
        self._task = self._bar.add_task("", total=len(jobs), completed=done, done=done, all=len(jobs), now="")

    def missing(self) -> list[Job]:
        """Return the jobs without a result."""
        return list(self._open)

    def __enter__(self) -> Display:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def show(self) -> None:
        """Read the runs' folders and move the bar, or print a line if one is due."""
        self._open = [job for job in self._open if finished(job, self.config) is None]
        shares = {job.name: self._share(job) for job in self._open}
        running = [job for job in self._open if shares[job.name] > 0]
        done = len(self.jobs) - len(self._open)
        completed = done + sum(shares.values())
        now = ", ".join(f"{job.label} {job.arm} {job.seed}" for job in running[:4])
        self._bar.update(self._task, completed=completed, done=done, now=now)
        if not console.is_terminal:
            self._print_line(completed, done, now)

    def _print_line(self, completed: float, done: int, now: str) -> None:
        """Print the progress if a line is due; the time left is measured from the first call on."""
        share = completed / len(self.jobs)
        if self._lines is None:
            self._lines = Lines(LINE_SHARE, first=share, begun=share, apart=LINE_SECONDS)
        left = self._lines.due(share)
        if left is not None:
            say(f"{done} of {len(self.jobs)} runs done, {share:.0%} of all{left}; now {now or 'starting'}")

    def _share(self, job: Job) -> float:
        """Return the share of a run's episodes that are done."""
        return last_episode(job.folder(self.config.folder) / "curve.csv") / self.episodes


def last_episode(path: Path) -> int:
    """Read the episode of the last whole line of a curve; 0 where there is none."""
    try:
        if not path.is_file():
            return 0
        with path.open("rb") as file:
            file.seek(0, 2)
            file.seek(max(0, file.tell() - TAIL_BYTES))
            lines = file.read().split(b"\n")
        return int(lines[-2].split(b",")[0])
    except (OSError, ValueError, IndexError):
        return 0


def seconds_per_run(jobs: list[Job], config: StudyConfig, episodes: int) -> tuple[float, str]:
    """Return the seconds of a run beside others, and what they were measured by."""
    known = [result.seconds for result in (finished(job, config) for job in jobs) if result]
    if len(known) >= MIN_FINISHED:
        return statistics.mean(known), f"the {len(known)} finished runs"
    if episodes <= LONG:
        return time_runs(config, episodes), f"runs of {episodes} episodes"
    # The first run compiles kernels, which a fresh installation has not in its cache.
    time_runs(config, 1)
    short, long = time_runs(config, SHORT), time_runs(config, LONG)
    each = max(0.0, (long - short) / (LONG - SHORT))
    return short + each * (episodes - SHORT), f"runs of {SHORT} and {LONG} episodes"


def time_runs(config: StudyConfig, episodes: int) -> float:
    """Return the mean seconds of short runs from scratch, as many at once as the study runs.

    Raises:
        RuntimeError: they failed; the text is the last line of their error output.
    """
    children: list[subprocess.Popen[str]] = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ends:
        for k in range(processes(config)):
            line = (f"target={CASE}", "method=scratch", f"profile={config.profile}", *config.run_overrides)
            short = (
                f"learn.episodes={episodes}",
                "learn.warmup_steps=100",
                f"seed={k}",
                f"output={folder}/{k}",
            )
            child = subprocess.Popen(
                [sys.executable, "-m", "ship_trl", *line, *short],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                preexec_fn=die_with_parent,
            )
            # If one fails, the others end before their folder is removed.
            ends.enter_context(child)
            ends.callback(child.kill)
            children.append(child)
        for child in children:
            _, said = child.communicate()
            if child.returncode != 0:
                raise RuntimeError(said.strip().splitlines()[-1] if said.strip() else "a short run failed")
        results = [read_result(path.parent) for path in Path(folder).glob(f"**/scratch/**/{RESULT}")]
    return statistics.mean(result.seconds for result in results)
