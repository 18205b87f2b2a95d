"""What a run shows: progress with time left, in a file or pipe as plain lines, then a short table."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from ship_trl.config.errors import one_line
from ship_trl.files.result import Result
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.progress import Lines, in_words

console = Console()
# A transfer beside learning from scratch, in a run's folder.
TRANSFER = "transfer.png"
# Shares of a run's episodes between two lines: of a run alone, and of one of many.
ALONE, ONE_OF_MANY = 0.05, 0.25
# Seconds: a shorter wait for another process is not worth a line; a longer one is said again.
SHORT_WAIT, LONG_WAIT = 1.0, 60.0


def say(text: str) -> None:
    """One line, whatever a stranger's file has put into it."""
    console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)


def progress(
    title: str, episodes: int, events: Iterable[Finished | Evaluated], place: str = "", begun: int = 0
) -> Iterator[Finished | Evaluated]:
    """Pass events on, and show episodes done, time left, and the last returns meanwhile.

    A terminal has a bar; a file or a pipe gets a line at the first episode and every twentieth of them.
    The runs of a grid, which share what they write to, say a line with their place and title every quarter.
    Of a run that goes on, `begun` episodes were sailed before.
    """
    columns = (
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("return {task.fields[now]:>7}  greedy {task.fields[greedy]:>7}"),
    )
    share = begun / episodes
    lines = Lines(ONE_OF_MANY, share + ONE_OF_MANY, share) if place else Lines(ALONE, share, share)
    start = f"{place}: {title}: " if place else ""
    plain, greedy = bool(place) or not console.is_terminal, ""
    with Progress(*columns, console=console, disable=plain) as bar:
        task = bar.add_task(title, total=episodes, completed=begun, now="", greedy="")
        for event in events:
            if isinstance(event, Evaluated):
                greedy = f"{event.sailed.episode_return:.1f}"
                bar.update(task, greedy=greedy)
            else:
                now = f"{event.episode_return:.1f}"
                bar.update(task, completed=event.episode, now=now)
                if plain and (left := lines.due(event.episode / episodes)) is not None:
                    say(f"{start}episode {event.episode} of {episodes}, return {now}, greedy {greedy}{left}")
            yield event


@contextmanager
def hold(lock: FileLock, what: str) -> Iterator[None]:
    """Hold a lock; while another process holds it, say on what this one waits, once and then every minute."""
    started, wait = time.monotonic(), SHORT_WAIT
    while True:
        try:
            lock.acquire(timeout=wait)
            break
        except Timeout:
            waited = in_words(time.monotonic() - started)
            say(f"waiting for another process that is at {what} ({waited} so far; {lock.lock_file})")
            wait = LONG_WAIT
    try:
        yield
    finally:
        lock.release()


def say_result(result: Result, folder: Path, place: str) -> None:
    """Say the result of one run of a grid, in a line."""
    best, final = result.best, result.final
    say(
        f"{place}: {result.title}: best {best.episode_return:.1f} ({best.outcome}), "
        f"final {final.episode_return:.1f} ({final.outcome}) of {result.best_known_return:.1f}, "
        f"{result.seconds:.0f} s; {folder}"
    )


def show_result(result: Result, folder: Path) -> None:
    """Print the table at the end of a run."""
    table = Table(title=result.title, title_justify="left")
    for name in ("greedy policy", "return", "of best", "ends with", "steps", "DCPA", "episode"):
        table.add_column(name, justify="left" if name in ("greedy policy", "ends with") else "right")
    known = result.best_known_return
    for name, row in (
        ("scratch, untrained", result.scratch),
        ("before training", result.before),
        ("best", result.best),
        ("final", result.final),
    ):
        # A share of the best says something only where both are gains.
        share = f"{row.episode_return / known:.0%}" if known > 0 and row.episode_return > 0 else "-"
        dcpa = "-" if row.dcpa is None else f"{row.dcpa:.0f} m"
        table.add_row(
            name, f"{row.episode_return:.1f}", share, row.outcome, str(row.length), dcpa, str(row.episode)
        )
    table.add_row("best known (planner)", f"{known:.1f}", "100%", "", "", "", "")
    console.print(table)
    say(
        f"{result.episodes} episodes, {result.steps} steps, {result.seconds:.0f} s; "
        f"goal in {result.training_goal_rate:.0%} of the training episodes, "
        f"collision in {result.training_collision_rate:.0%}"
    )
    there = [name for name in (TRANSFER, "curve.png", "episode.gif") if (folder / name).is_file()]
    say(f"{folder}: {', '.join([*there, 'curve.csv', 'result.json', 'policy.safetensors'])}")
    say_next(result, folder)


def say_next(result: Result, folder: Path) -> None:
    """Say what to look at, and what to do with the policy."""
    if (folder / TRANSFER).is_file():
        say(f"  beside learning from scratch: {folder / TRANSFER}")
    elif result.source is not None:
        say("  no run from scratch of these settings to compare with; +arm=scratch makes one")
    say(f"  see it sail: python -m ship_trl watch {folder}")
    say("  see a ship give way to two others: python -m ship_trl watch pretrained target=4")
