"""Print the progress of a run with the time left, then a table of results; plain lines in a file or pipe."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ship_trl.config.command import command
from ship_trl.config.errors import one_line
from ship_trl.files.record import Evaluation, RunRecord
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.progress import Lines, format_duration
from ship_trl.run.table import show
from ship_trl.sim.suites import describe

console = Console()
# Columns of the table at the end of a run.
HEADINGS = ("greedy policy", "return", "of best", "ends with", "steps", "least distance", "episode")
# Picture in a run's folder that compares a transfer with learning from scratch.
TRANSFER = "transfer.png"
# Share of a run's episodes between two progress lines, in a single run and in a run of a grid.
SINGLE_INTERVAL, GRID_INTERVAL = 0.05, 0.25
# Seconds until the first message that this process waits for another one, and between further messages.
SHORT_WAIT, LONG_WAIT = 1.0, 60.0


def say(text: str) -> None:
    """Print a text as one line, even if an untrusted file put line breaks into it."""
    console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)


def progress(
    title: str,
    episodes: int,
    events: Iterable[Finished | Evaluated],
    place: str = "",
    done: int = 0,
    greedy: str = "",
) -> Iterator[Finished | Evaluated]:
    """Yield the events, and show finished episodes, time left and the last returns.

    A terminal gets a bar. A file or a pipe gets a line at the first episode and after every 5 % of the
    episodes. A run of a grid prints a line with its place and title after every 25 %, because all runs share
    the output. The estimate of the time left begins with the first update, because the warm-up is faster.

    `place` is the run's place in a grid, such as `3 of 40`; it is empty outside a grid. `done` episodes of
    `episodes` were finished before the run was resumed, and `greedy` is its last evaluation.
    """
    columns = (
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("return {task.fields[now]:>7}  greedy {task.fields[greedy]:>7}"),
    )
    share = done / episodes
    lines = (
        Lines(GRID_INTERVAL, share + GRID_INTERVAL, share) if place else Lines(SINGLE_INTERVAL, share, share)
    )
    prefix = f"{place}: {title}: " if place else ""
    plain = bool(place) or not console.is_terminal
    has_updates = is_measured = False
    with Progress(*columns, console=console, disable=plain) as bar:
        task = bar.add_task(title, start=False, total=episodes, completed=done, now="", greedy=greedy)
        for event in events:
            if isinstance(event, Evaluated):
                greedy = describe_greedy(event.episode_return, event.success_rate, len(event.episodes))
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
                    # The next line's estimate uses the pace since this line.
                    is_measured = has_updates
            yield event


def describe_greedy(episode_return: float, success_rate: float, episodes: int) -> str:
    """Return the mean return of an evaluation, of several episodes with their success rate."""
    return f"{episode_return:.1f}" + (f" ({success_rate:.0%} goal)" if episodes > 1 else "")


@contextmanager
def hold(lock: FileLock, what: str) -> Iterator[None]:
    """Hold a lock; while another process has it, print every minute what this process waits for."""
    started, wait = time.monotonic(), SHORT_WAIT
    while not lock.is_locked:
        try:
            lock.acquire(timeout=wait)
        except Timeout:
            waited = format_duration(time.monotonic() - started)
            say(f"waiting {waited} for another process that trains {what} ({lock.lock_file})")
            wait = LONG_WAIT
    try:
        yield
    finally:
        lock.release()


def say_result(result: RunRecord, title: str, folder: Path, place: str) -> None:
    """Print the result of a run of a grid in one line."""
    best, final = result.best, result.final
    known = "" if result.best_known_return is None else f" of {result.best_known_return:.1f}"
    say(
        f"{place}: {title}: best {best.episode_return:.1f} ({describe_end(best)}), "
        f"final {final.episode_return:.1f} ({describe_end(final)}){known}, {result.seconds:.0f} s; {folder}"
    )


def describe_end(evaluation: Evaluation) -> str:
    """Return the outcome of an evaluation's episode, or the success rate of several."""
    if evaluation.episodes == 1:
        return evaluation.outcome
    return f"{evaluation.success_rate:.0%} goal"


def format_share(value: float, known: float | None) -> str:
    """Return a return as a share of the best known one; it makes sense only if both are positive."""
    return f"{value / known:.0%}" if known is not None and min(known, value) > 0 else "-"


def show_result(result: RunRecord, title: str, folder: Path, is_course_best: bool) -> None:
    """Print the end of a run: a table, its files, what to look at next, and whether nothing is avoided."""
    known, source, rows = result.best_known_return, result.on_source, []
    for name, row in (
        ("scratch, untrained", result.scratch),
        ("before training", result.before),
        ("best", result.best),
        ("final", result.final),
    ):
        share = format_share(row.episode_return, known)
        nearest = "-" if row.dcpa is None else f"{row.dcpa:.0f} m"
        numbers = str(row.length), nearest, str(row.episode)
        rows.append((name, f"{row.episode_return:.1f}", share, describe_end(row), *numbers))
    if known is not None:
        rows.append(("best known (planner)", f"{known:.1f}", "100%", "", "", "", ""))
    show(HEADINGS, rows, title=title)
    if source is not None:
        case = describe(str(result.source))
        say(f"Forgetting on {case}: {source.network:.1f} before, {source.final:.1f} after")
    say(
        f"{result.episodes} episodes, {result.steps} steps, {result.seconds:.0f} s; "
        f"goal in {result.training_goal_rate:.0%} of the training episodes, "
        f"collision in {result.training_collision_rate:.0%}"
    )
    pictures = [name for name in (TRANSFER, "curve.png", "episode.gif") if (folder / name).is_file()]
    say(f"{folder}: {', '.join([*pictures, 'curve.csv', 'result.json', 'policy.safetensors'])}")
    if TRANSFER in pictures:
        say(f"  beside learning from scratch: {folder / TRANSFER}")
    elif result.source is not None:
        say("  no run from scratch of these settings to compare with; to train one: +arm=scratch")
    say(f"  watch it: {command('watch', folder)}")
    if is_course_best:
        say(
            f"  in {describe(result.target)} holding course is best, so that no run shows avoidance; "
            "+pair=low has ships to avoid"
        )
