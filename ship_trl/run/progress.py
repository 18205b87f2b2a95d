"""Progress as plain lines, for a file or a pipe: when a line is due, and the time left. No torch."""

from __future__ import annotations

import time
from collections.abc import Callable


def in_words(seconds: float) -> str:
    """Write a duration as hours and minutes, or as seconds."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


class Lines:
    """Decides when a line is due, by the share of the work that is done.

    Args:
        every: share of the work between two lines.
        first: share at which the first line is due.
        begun: share that was done before.
        apart: minimum seconds between two lines.
        clock: returns the time in seconds.
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
        """Return the time left in words if a line is due, else None; empty if it is not known yet.

        It is estimated from the pace since the last line, because the first steps of a run learn nothing and
        are quicker.
        """
        now = self._clock()
        if share < self._next - 1e-9 or now - self._said < self._apart:
            return None
        gained = share - self._share
        known = share < 1.0 and gained >= 0.9 * self._every
        left = f", about {in_words((1.0 - share) * (now - self._said) / gained)} left" if known else ""
        self._said, self._share = now, share
        # A multiple of `every`, so that rounding errors do not add up.
        self._next = self._every * (int(share / self._every + 1e-9) + 1)
        return left
