"""What a run prints: progress with the time left, then a table of results; plain lines in a file or pipe."""

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
# Picture in a run's folder that compares a transfer with learning from scratch.
TRANSFER = "transfer.png"
# Share of a run's episodes between two progress lines: for a single run, and for a run of a grid.
SINGLE_INTERVAL, GRID_INTERVAL = 0.05, 0.25
# Seconds to wait for another process before the first message about it, and between further ones.
SHORT_WAIT, LONG_WAIT = 1.0, 60.0


def say(text: str) -> None:
    """Print a text as one line, even if an untrusted file put line breaks into it."""
    console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)


def progress(
    title: str, episodes: int, events: Iterable[Finished | Evaluated], place: str = "", done: int = 0
) -> Iterator[Finished | Evaluated]:
    """Yield the events, and meanwhile show finished episodes, time left and the last returns.

    A terminal gets a bar. A file or a pipe gets a line at the first episode and every 5 % of them. A run of
    a grid prints a line with its place and title every 25 %, because all runs share the output. The warm-up
    makes no updates, so its pace says nothing about the time left: the estimate begins with the first update.

    Args:
        title: the run in words.
        episodes: how many the run has.
        events: what the training yields.
        place: the run's place in a grid, else empty.
        done: episodes that were finished before the run was resumed.
    """
    columns = (
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("return {task.fields[now]:>7}  greedy {task.fields[greedy]:>7}"),
    )
    share = done / episodes
    if place:
        lines = Lines(GRID_INTERVAL, share + GRID_INTERVAL, share)
    else:
        lines = Lines(SINGLE_INTERVAL, share, share)
    prefix = f"{place}: {title}: " if place else ""
    plain, greedy = bool(place) or not console.is_terminal, ""
    has_updates = is_measured = False
    with Progress(*columns, console=console, disable=plain) as bar:
        task = bar.add_task(title, start=False, total=episodes, completed=done, now="", greedy="")
        for event in events:
            if isinstance(event, Evaluated):
                greedy = f"{event.sailed.episode_return:.1f}"
                bar.update(task, greedy=greedy)
            else:
                now = f"{event.episode_return:.1f}"
                if event.loss is not None and not has_updates:
                    has_updates = True
                    bar.start_task(task)
                bar.update(task, completed=event.episode, now=now)
                if plain and (left := lines.due(event.episode / episodes)) is not None:
                    left = left if is_measured else ""
                    say(f"{prefix}episode {event.episode} of {episodes}, return {now}, greedy {greedy}{left}")
                    # The pace of the next line is that since this one.
                    is_measured = has_updates
            yield event


@contextmanager
def hold(lock: FileLock, what: str) -> Iterator[None]:
    """Hold a lock; while another process has it, print what this one waits for, every minute."""
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
    """Print the result of a run of a grid in one line."""
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
        # A percentage of the best return makes sense only if both are positive.
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
    pictures = [name for name in (TRANSFER, "curve.png", "episode.gif") if (folder / name).is_file()]
    say(f"{folder}: {', '.join([*pictures, 'curve.csv', 'result.json', 'policy.safetensors'])}")
    say_next(result, folder)


def say_next(result: Result, folder: Path) -> None:
    """Print what to look at, and how to watch the policy."""
    if (folder / TRANSFER).is_file():
        say(f"  beside learning from scratch: {folder / TRANSFER}")
    elif result.source is not None:
        say("  no run from scratch of these settings to compare with; +arm=scratch makes one")
    say(f"  watch it: python -m ship_trl watch {folder}")
    say("  watch a ship give way to two others: python -m ship_trl watch pretrained target=4")
