"""Progress with the time left: a bar, or plain lines for a file or a pipe. No torch."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

# Apart from what a command prints, which may be piped.
console = Console(stderr=True)
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
    lines, plain = Lines(INTERVAL, apart=LINE_SECONDS), not console.is_terminal
    columns = TextColumn(label), BarColumn(bar_width=20), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, disable=plain) as bar:
        task = bar.add_task(label, total=1.0)

        def show(share: float) -> None:
            bar.update(task, completed=share)
            if plain and (left := lines.due(share)) is not None:
                words = f"{round(share * of)} of {of}" if of else f"{share:.0%}"
                console.print(f"{label}: {words} done{left}", highlight=False)

        yield show


def track(label: str, items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items, and show how many are done."""
    with show_share(label, len(items)) as show:
        for done, item in enumerate(items):
            if done:
                show(done / len(items))
            yield item
