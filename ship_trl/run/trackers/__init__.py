"""Log a run's numbers: always to CSV, and to the trackers that `logger` names, which are a file each here.

The file `NAME.py` has a function `start`, which makes a `Tracker` of a run. `logger=NAME` is then allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from importlib import import_module
from types import TracebackType
from typing import Protocol

from ship_trl.config.types import trackers_of
from ship_trl.files.curve import Row
from ship_trl.files.record import RunRecord
from ship_trl.run.plan import Run, open_folder


class Tracker(Protocol):
    """A place that a run is logged to. It is made before anything in the run's folder is touched."""

    def begin(self) -> None:
        """Begin, in a folder without the files of an earlier run."""

    def log(self, row: Row) -> None:
        """Log the row of an event."""

    def finish(self, result: RunRecord) -> None:
        """Log the result; the folder holds the pictures."""

    def close(self, failed: bool) -> None:
        """Close the files, also after an error."""


class Trackers:
    """A context that logs to the trackers of a run, and closes them even if the run fails.

    `rows` are the earlier events of a resumed run. They are logged again, because no tracker stores them.
    """

    def __init__(self, run: Run, rows: Sequence[Row] = ()) -> None:
        self._run, self._rows = run, list(rows)
        self._all: list[Tracker] = []

    def __enter__(self) -> Trackers:
        modules = (import_module(f"{__name__}.{name}") for name in trackers_of(self._run.config.logger))
        started: list[Tracker] = [module.start(self._run) for module in modules]
        open_folder(self._run, resume=bool(self._rows))
        with ExitStack() as entering:
            # Closes what has begun if another cannot begin, as on a full disk.
            entering.push(self)
            for tracker in started:
                tracker.begin()
                self._all.append(tracker)
                for row in self._rows:
                    tracker.log(row)
            entering.pop_all()
        return self

    def log(self, row: Row) -> None:
        """Log the row of an event with all trackers."""
        for tracker in self._all:
            tracker.log(row)

    def finish(self, result: RunRecord) -> None:
        """Log the result with all trackers."""
        for tracker in self._all:
            tracker.finish(result)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A stack, so that an error in one `close` does not keep the others open.
        with ExitStack() as stack:
            for tracker in reversed(self._all):
                stack.callback(tracker.close, failed=kind is not None)
