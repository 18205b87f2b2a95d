"""Log a run's numbers: always to CSV, and to wandb and TensorBoard if `logger` asks for them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from ship_trl.config.types import Logger
from ship_trl.files.curve import COLUMNS, CURVE
from ship_trl.files.disk import writing
from ship_trl.files.result import Result
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run.folder import open_folder
from ship_trl.run.rows import row
from ship_trl.run.run import Run
from ship_trl.run.tensorboard_tracker import TensorboardTracker
from ship_trl.run.wandb_tracker import WandbTracker, begin_wandb


class CsvTracker:
    """Writes `curve.csv`, one line per event, flushed at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / CURVE
        self._file = self._path.open("w", newline="")
        self._writer = csv.DictWriter(self._file, COLUMNS, restval="", lineterminator="\n")
        self._writer.writeheader()

    def log(self, values: dict[str, Any]) -> None:
        """Write a row; floats keep all digits, so that equal runs give equal bytes."""
        with writing(self._path):
            self._writer.writerow(values)
            self._file.flush()

    def close(self) -> None:
        """Close the file."""
        with writing(self._path):
            self._file.close()


class Tracker:
    """A context that logs to CSV and to what `logger` asks for, and closes them however the run ends.

    Args:
        run: the run that is logged.
        rows: earlier events of a resumed run. All trackers get them again, so that none needs a memory of its
            own.
    """

    def __init__(self, run: Run, rows: Sequence[dict[str, Any]] = ()) -> None:
        self._run, self._rows = run, list(rows)
        self._others: list[WandbTracker | TensorboardTracker] = []

    def __enter__(self) -> Tracker:
        logger = self._run.config.logger
        # wandb first: if it refuses, no file of an earlier run has been touched.
        wandb = begin_wandb(self._run) if logger.includes(Logger.wandb) else None
        open_folder(self._run, resume=bool(self._rows))
        if wandb is not None:
            wandb.remember()
            self._others.append(wandb)
        self._csv = CsvTracker(self._run.folder)
        if logger.includes(Logger.tensorboard):
            self._others.append(TensorboardTracker(self._run))
        for values in self._rows:
            self._log(values)
        return self

    def log(self, event: Finished | Evaluated) -> None:
        """Log an event everywhere."""
        self._log(row(event))

    def _log(self, values: dict[str, Any]) -> None:
        self._csv.log(values)
        for tracker in self._others:
            tracker.log(values)

    def finish(self, result: Result) -> None:
        """Report the result."""
        for tracker in self._others:
            tracker.finish(result, self._run.folder)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A stack closes the others if one fails.
        with ExitStack() as stack:
            for tracker in self._others:
                stack.callback(tracker.close, failed=kind is not None)
            stack.callback(self._csv.close)
