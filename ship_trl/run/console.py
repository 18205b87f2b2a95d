"""Print tables, progress with the time left, and results; plain lines in a file or pipe. No torch."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table

from ship_trl.config.errors import command, counted, escape, one_line
from ship_trl.files.curve import Row
from ship_trl.sim.cases import describe

if TYPE_CHECKING:
    from ship_trl.files.record import Evaluation, RunRecord

console = Console()
# Columns of the table at the end of a run.
HEADINGS = ("greedy policy", "return", "of best", "ends with", "steps", "least distance", "episode")
# Picture in a run's folder that compares a transfer with learning from scratch.
TRANSFER = "transfer.png"
# Share of a run's episodes between two progress lines, in a single run and in a run of a grid.
SINGLE_INTERVAL, GRID_INTERVAL = 0.05, 0.25
# Seconds whose pace an estimate of the time left is of, and characters of a line in a file at most.
PACE_SECONDS, MAX_WIDTH = 600.0, 1_000_000
# Least seconds between two lines of `show_share`.
LINE_SECONDS = 5.0
# Blank characters between two columns of a table.
GAP = 2
# Seconds until the first message that this process waits for another one, and between further messages.
SHORT_WAIT, LONG_WAIT = 1.0, 60.0


def say(text: str) -> None:
    """Print a text as one line, even if an untrusted file put line breaks into it."""
    console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)


def progress(
    title: str, episodes: int, rows: Iterable[Row], place: str = "", done: int = 0, greedy: str = ""
) -> Iterator[Row]:
    """Yield the rows of `curve.csv`, and show finished episodes, time left and the last returns.

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
    interval, share = GRID_INTERVAL if place else SINGLE_INTERVAL, done / episodes
    lines = Lines(interval, share + interval if place else share)
    prefix = f"{place}: {title}: " if place else ""
    plain = bool(place) or not console.is_terminal
    with Progress(*columns, console=console, disable=plain, speed_estimate_period=PACE_SECONDS) as bar:
        task = bar.add_task(title, start=False, total=episodes, completed=done, now="", greedy=greedy)
        for row in rows:
            if "greedy_return" in row:
                greedy = describe_greedy(row)
                bar.update(task, greedy=greedy)
            else:
                episode, now = row["episode"], f"{row['return']:.1f}"
                if "loss" in row and not bar.tasks[0].started:
                    bar.reset(task, completed=episode - 1)
                bar.update(task, completed=episode, now=now)
                if plain and lines.due(episode / episodes):
                    left = time_left(bar)
                    say(f"{prefix}episode {episode} of {episodes}, return {now}, greedy {greedy}{left}")
            yield row


def describe_greedy(row: Row) -> str:
    """Return the mean return of an evaluation, of several episodes with their success rate."""
    rate = f" ({row['greedy_success_rate']:.0%} goal)" if row["greedy_episodes"] > 1 else ""
    return f"{row['greedy_return']:.1f}{rate}"


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
    known = "" if result.best_known_return is None else f" of {result.best_known_return:.1f}"
    best, final = (f"{one.episode_return:.1f} ({describe_end(one)})" for one in (result.best, result.final))
    say(f"{place}: {title}: best {best}, final {final}{known}, {result.seconds:.0f} s; {folder}")


def describe_end(evaluation: Evaluation) -> str:
    """Return the outcome of an evaluation's episode, or the success rate of several."""
    return evaluation.outcome if evaluation.episodes == 1 else f"{evaluation.success_rate:.0%} goal"


def show_result(result: RunRecord, title: str, folder: Path, is_course_best: bool) -> None:
    """Print the end of a run: a table, its files, what to look at next, and whether nothing is avoided."""
    known, source, rows = result.best_known_return, result.on_source, []
    for name, row in (
        ("untrained", result.untrained),
        ("before training", result.before),
        ("best", result.best),
        ("final", result.final),
    ):
        reached = row.episode_return
        # Makes sense only if both are positive.
        share = f"{reached / known:.0%}" if known is not None and min(known, reached) > 0 else "-"
        nearest = "-" if row.dcpa is None else f"{row.dcpa:.0f} m"
        end = describe_end(row)
        rows.append((name, f"{reached:.1f}", share, end, str(row.length), nearest, str(row.episode)))
    if known is not None:
        rows.append(("best known (planner)", f"{known:.1f}", "100%", "", "", "", ""))
    show(HEADINGS, rows, title=title)
    if source is not None:
        case = describe(str(result.source))
        say(f"Forgetting on {case}: greedy return {source.network:.1f} before, {source.final:.1f} after")
    say(
        f"{counted(result.episodes, 'episode')}, {counted(result.steps, 'step')}, {result.seconds:.0f} s; "
        f"goal in {result.training_goal_rate:.0%} of the training episodes, "
        f"collision in {result.training_collision_rate:.0%}"
    )
    pictures = [name for name in (TRANSFER, "curve.png", "episode.gif") if (folder / name).is_file()]
    say(f"{folder}: {', '.join([*pictures, 'curve.csv', 'result.json', 'policy.safetensors'])}")
    if TRANSFER in pictures:
        say(f"  beside learning from scratch: {folder / TRANSFER}")
    elif result.source is not None:
        say(
            "  no run from scratch of these settings was there to compare with; +arm=scratch trains one, "
            "the verb results compares them"
        )
    say(f"  watch it: {command('watch', folder)}")
    if is_course_best:
        say(
            f"  in {describe(result.target)} holding course is best, so that no run shows avoidance; "
            "+pair=low has ships to avoid"
        )


# Apart from what a command prints, which may be piped.
stderr = Console(stderr=True)
# Shows the share of the work that is done.
Show = Callable[[float], None]


def format_duration(seconds: float) -> str:
    """Format a duration as hours and minutes, or as seconds."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


class Lines:
    """Decides when a line is due: at the share `first` of the work, then after `every` more.

    At least `apart` seconds lie between two lines.
    """

    def __init__(self, every: float, first: float = 0.0, apart: float = 0.0) -> None:
        self._every, self._next, self._apart = every, first, apart
        self._last = time.monotonic()

    def due(self, share: float) -> bool:
        """Return whether a line is due when a share of the work is done."""
        now = time.monotonic()
        if share < self._next - 1e-9 or now - self._last < self._apart:
            return False
        # A multiple of `every`, so that rounding errors do not add up.
        self._last, self._next = now, self._every * (int(share / self._every + 1e-9) + 1)
        return True


def time_left(bar: Progress) -> str:
    """Return the end of a line that says how long the only task still takes; empty while that is unknown."""
    seconds = bar.tasks[0].time_remaining
    return f", about {format_duration(seconds)} left" if seconds else ""


@contextmanager
def show_share(label: str) -> Iterator[Show]:
    """Yield a function that shows the share of the work that is done: a bar in a terminal, else lines."""
    lines, is_plain = Lines(SINGLE_INTERVAL, apart=LINE_SECONDS), not stderr.is_terminal
    columns = TextColumn(label), BarColumn(bar_width=20), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=stderr, disable=is_plain) as bar:
        task = bar.add_task(label, total=1.0)

        def show(share: float) -> None:
            bar.update(task, completed=share)
            if is_plain and lines.due(share):
                stderr.print(f"{label}: {share:.0%} done{time_left(bar)}", highlight=False)

        yield show


def show(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    markdown: bool = False,
    title: str | None = None,
    shown: Container[str] | None = None,
) -> None:
    """Print the `shown` columns of a table, or all, with a title above.

    In a terminal cells are wrapped between words. A file or a pipe has lines of any length, and so has a
    terminal that is too narrow for the words.
    """
    kept = [k for k, heading in enumerate(headings) if shown is None or heading in shown]
    # Names from foreign files must not control a terminal.
    headings, *rows = ([escape(cells[k]) for k in kept] for cells in (headings, *rows))
    if markdown:
        lines = (headings, ["---"] * len(headings), *rows)
        above = f"{title}\n\n" if title else ""
        sys.stdout.write(above + "".join(f"| {' | '.join(row)} |\n" for row in lines) + "\n")
        return
    paper = Console(highlight=False, markup=False)
    limit, paper.width = paper.width if paper.is_terminal else MAX_WIDTH, MAX_WIDTH
    columns = list(zip(headings, *rows, strict=True))
    # Whole, with headings wrapped, with all cells wrapped; of its own accord rich would cut words.
    ways = (
        columns,
        [(*heading.split(), *cells) for heading, *cells in columns],
        [" ".join(column).split() for column in columns],
    )
    widths = [[max(map(cell_len, parts), default=0) for parts in way] for way in ways]
    fitting = next((one for one in widths if sum(one) + GAP * (len(one) - 1) <= limit), widths[-1])
    some = [Column(heading, width=width) for heading, width in zip(headings, fitting, strict=True)]
    table = Table(*some, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for row in rows:
        table.add_row(*row)
    if title:
        paper.print(title)
    paper.print(table)
    paper.print()
