"""One progress display for a whole study: runs done, and how far the others are; lines without a terminal."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ship_trl.run.progress import Lines
from ship_trl.study.launch.launch import finished
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import Job

console = Console(highlight=False)
# The last line of a learning curve is not longer.
TAIL = 400
# Where there is no terminal: a line for so much more of the study, and seconds between two at least.
SHARE, APART = 0.01, 60.0


def say(text: str) -> None:
    """One line."""
    console.print(text, markup=False, soft_wrap=True)


class Display:
    """A bar of runs; a run that goes on counts by its share of episodes.

    Args:
        jobs: all runs of the study.
        config: where they lie.
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
        """List the runs without a result."""
        return list(self._open)

    def __enter__(self) -> Display:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def show(self) -> None:
        """Look at the folders and move the bar, or say a line if one is due."""
        self._open = [job for job in self._open if finished(job, self.config) is None]
        shares = {job.name: self._share(job) for job in self._open}
        going = [job for job in self._open if shares[job.name] > 0]
        done = len(self.jobs) - len(self._open)
        completed = done + sum(shares.values())
        now = ", ".join(f"{job.label} {job.arm} {job.seed}" for job in going[:4])
        self._bar.update(self._task, completed=completed, done=done, now=now)
        if not console.is_terminal:
            self._say(completed, done, now)

    def _say(self, completed: float, done: int, now: str) -> None:
        """Say how far the study is, if a line is due; time left is measured from the first call on."""
        share = completed / len(self.jobs)
        if self._lines is None:
            self._lines = Lines(SHARE, first=share, begun=share, apart=APART)
        left = self._lines.due(share)
        if left is not None:
            say(f"{done} of {len(self.jobs)} runs done, {share:.0%} of all{left}; now {now or 'starting'}")

    def _share(self, job: Job) -> float:
        """How much of a run's episodes are behind it."""
        return last_episode(job.folder(self.config.folder) / "curve.csv") / self.episodes


def last_episode(path: Path) -> int:
    """Read the last whole line's episode; 0 where there is none."""
    try:
        if not path.is_file():
            return 0
        with path.open("rb") as file:
            file.seek(0, 2)
            file.seek(max(0, file.tell() - TAIL))
            lines = file.read().split(b"\n")
        return int(lines[-2].split(b",")[0])
    except (OSError, ValueError, IndexError):
        return 0
