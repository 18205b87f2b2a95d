"""Print tables, progress with the time left, and results; plain lines in a file or pipe. No torch."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

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

from ship_trl.config.command import command
from ship_trl.config.errors import escape, one_line
from ship_trl.sim.suites import describe

if TYPE_CHECKING:
    from ship_trl.files.record import Evaluation, RunRecord
    from ship_trl.learn.train import Evaluated, Finished

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
    from ship_trl.learn.train import Evaluated

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


# Apart from what a command prints, which may be piped.
stderr = Console(stderr=True)
Item = TypeVar("Item")
# Shows the share of the work that is done.
Show = Callable[[float], None]
# Share of the work and least seconds between two lines of `show_share`.
INTERVAL, LINE_SECONDS = 0.05, 5.0


def format_duration(seconds: float) -> str:
    """Format a duration as hours and minutes, or as seconds."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


class Lines:
    """Decides when a line is due from the share of the work that is done.

    The first line is due at the share `first`, further ones after `every` more, at least `apart` seconds
    later. The share `begun` was done before this process started.
    """

    def __init__(
        self,
        every: float,
        first: float = 0.0,
        begun: float = 0.0,
        apart: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._every, self._next, self._apart, self._clock = every, first, apart, clock
        self._last_time, self._last_share = clock(), begun

    def due(self, share: float) -> str | None:
        """Return the time left as text if a line is due, else None; the text is empty if the time is unknown.

        The estimate uses the pace since the last line, because the first steps of a run make no updates and
        are faster.
        """
        seconds, gained = self._clock() - self._last_time, share - self._last_share
        if share < self._next - 1e-9 or seconds < self._apart:
            return None
        self._last_time, self._last_share = self._last_time + seconds, share
        # A multiple of `every`, so that rounding errors do not add up.
        self._next = self._every * (int(share / self._every + 1e-9) + 1)
        if share >= 1.0 or gained < 0.9 * self._every:
            return ""
        return f", about {format_duration((1.0 - share) * seconds / gained)} left"


@contextmanager
def show_share(label: str, of: int = 0) -> Iterator[Show]:
    """Yield a function that shows progress: a bar in a terminal, else lines in percent or `of` items."""
    lines, plain = Lines(INTERVAL, apart=LINE_SECONDS), not stderr.is_terminal
    columns = TextColumn(label), BarColumn(bar_width=20), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=stderr, disable=plain) as bar:
        task = bar.add_task(label, total=1.0)

        def show(share: float) -> None:
            bar.update(task, completed=share)
            if plain and (left := lines.due(share)) is not None:
                words = f"{round(share * of)} of {of}" if of else f"{share:.0%}"
                stderr.print(f"{label}: {words} done{left}", highlight=False)

        yield show


def track(label: str, items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items, and show how many are done."""
    with show_share(label, len(items)) as show:
        for done, item in enumerate(items):
            if done:
                show(done / len(items))
            yield item


# Blank characters between two columns, and the least characters of a line.
GAP, MIN_WIDTH = 2, 40


def show(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    markdown: bool = False,
    title: str | None = None,
    names: int = 1,
    shown: Container[str] | None = None,
) -> None:
    """Print the `shown` columns of a table, or all, with a title above.

    A table that is too wide for the terminal is printed in parts; each begins with the first `names` columns,
    which identify the rows. Only a cell that is wider than a whole line is wrapped, between words. A file or
    a pipe has lines of any length.
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
    columns = [list(column) for column in zip(headings, *rows, strict=True)]
    whole = [max(map(cell_len, column)) for column in columns]
    in_a_line = max(sum(whole) + GAP * len(whole), cell_len(title or ""), MIN_WIDTH)
    paper.width = max(paper.width, MIN_WIDTH) if paper.is_terminal else in_a_line
    for part, widths in split(columns, whole, paper.width, names):
        some = [Column(columns[k][0], width=width) for k, width in zip(part, widths, strict=True)]
        table = Table(*some, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
        for row in rows:
            table.add_row(*(row[k] for k in part))
        if title:
            paper.print(title)
        paper.print(table)
        paper.print()
        title = None


def split(
    columns: Sequence[Sequence[str]], whole: Sequence[int], limit: int, names: int
) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the columns of each part of a table, and their widths.

    `columns` have a heading, then cells; `whole` are their widths, and a line has `limit` characters.
    """
    if sum(whole) + GAP * (len(whole) - 1) <= limit:
        yield list(range(len(whole))), list(whole)
        return
    # Headings are wrapped between words.
    widths = [max(map(cell_len, (*head.split(), *cells))) for head, *cells in columns]
    # Long names leave half of the line to the others.
    first = [min(width, limit // 2 // names) for width in widths[:names]]
    room = limit - sum(first) - GAP * names
    part: list[int] = []
    used: list[int] = []
    for k, width in enumerate(widths[names:], names):
        width = min(width, room)
        if part and sum(used) + GAP * len(used) + width > room:
            yield [*range(names), *part], [*first, *used]
            part, used = [], []
        part.append(k)
        used.append(width)
    yield [*range(names), *part], [*first, *used]
