"""Progress as plain lines, for a file or a pipe: when a line is due, and the time left. No torch."""

from __future__ import annotations

import time
from collections.abc import Callable


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
