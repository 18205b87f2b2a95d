"""Where a run's numbers go: CSV always, wandb and TensorBoard beside it where they are asked for."""

from __future__ import annotations

import csv
import shutil
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from omegaconf import OmegaConf

from ship_trl.config import ConfigError, Logger
from ship_trl.curve import COLUMNS, CURVE
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.paths import replacing, writing
from ship_trl.result import Result
from ship_trl.run.plan import Run
from ship_trl.run.rows import row
from ship_trl.run.tensorboard_tracker import TensorboardTracker
from ship_trl.run.wandb_tracker import WandbTracker
from ship_trl.transfer.casebase import CONFIG


def open_folder(run: Run) -> None:
    """Make the run's folder afresh and write its configuration.

    What is there is an unfinished run, or one that `overwrite=true` gives up.
    """
    try:
        shutil.rmtree(run.folder, ignore_errors=True)
        run.folder.mkdir(parents=True, exist_ok=True)
        with replacing(run.folder / CONFIG) as draft:
            OmegaConf.save(OmegaConf.structured(run.config), draft)
    except OSError as error:
        place = error.filename or run.folder
        raise ConfigError(f"output: {place} cannot be written: {error.strerror}") from None


class CsvTracker:
    """`curve.csv`, a line an event, written as it goes."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / CURVE
        self._file = self._path.open("w", newline="")
        self._writer = csv.DictWriter(self._file, COLUMNS, restval="", lineterminator="\n")
        self._writer.writeheader()

    def log(self, event: Finished | Evaluated) -> None:
        """Write one event; floats in full, so that equal runs give equal bytes."""
        with writing(self._path):
            self._writer.writerow(row(event))
            self._file.flush()

    def close(self) -> None:
        """End the file."""
        with writing(self._path):
            self._file.close()


class Tracker:
    """CSV and what `logger` asks for beside it; a context that ends them all however the run ends."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._beside: list[WandbTracker | TensorboardTracker] = []

    def __enter__(self) -> Tracker:
        logger = self._run.config.logger
        # wandb first: it can refuse, and then no file of an earlier run has been touched.
        if logger.includes(Logger.wandb):
            self._beside.append(WandbTracker(self._run))
        open_folder(self._run)
        self._csv = CsvTracker(self._run.folder)
        if logger.includes(Logger.tensorboard):
            self._beside.append(TensorboardTracker(self._run))
        return self

    def log(self, event: Finished | Evaluated) -> None:
        """Log one event everywhere."""
        self._csv.log(event)
        for tracker in self._beside:
            tracker.log(event)

    def finish(self, result: Result) -> None:
        """Report the result."""
        for tracker in self._beside:
            tracker.finish(result, self._run.folder)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A stack ends the others where one fails.
        with ExitStack() as stack:
            for tracker in self._beside:
                stack.callback(tracker.close, failed=kind is not None)
            stack.callback(self._csv.close)
