"""Progress in plain lines, for a file or a pipe: when one is due, and how long is left. No torch."""

from __future__ import annotations

import time
from collections.abc import Callable


def in_words(seconds: float) -> str:
    """Hours and minutes, or seconds."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


class Lines:
    """When a line is due, by the share of the work that is done.

    Args:
        every: so much more of it between two lines.
        first: the share of the first line.
        begun: the share that was done before.
        apart: seconds between two lines at least.
        clock: tells the time in seconds.
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
        self._said, self._share = clock(), begun

    def due(self, share: float) -> str | None:
        """Return None where no line is due; else how long is left, empty where nobody can know it yet.

        It is measured by the pace since the last line: the first steps of a run are quicker, for they learn
        nothing.
        """
        now = self._clock()
        if share < self._next - 1e-9 or now - self._said < self._apart:
            return None
        gained = share - self._share
        known = share < 1.0 and gained >= 0.9 * self._every
        left = f", about {in_words((1.0 - share) * (now - self._said) / gained)} left" if known else ""
        self._said, self._share = now, share
        # Whole steps, so that rounding does not add up.
        self._next = self._every * (int(share / self._every + 1e-9) + 1)
        return left
