"""Log a run's numbers: always to CSV, and to wandb and TensorBoard if `logger` asks for them."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
from PIL import Image

from ship_trl.config.types import Logger, plain
from ship_trl.files.curve import COLUMNS, CURVE
from ship_trl.files.disk import writing
from ship_trl.files.record import RunRecord
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.run import console
from ship_trl.run.folder import open_folder
from ship_trl.run.history import Row, to_csv, to_numbers, to_row
from ship_trl.run.run import Run
from ship_trl.run.wandb_tracker import WandbTracker, begin_wandb

# A code block in TensorBoard's Markdown.
CODE_BLOCK = "```\n{}\n```"


class CsvTracker:
    """Writes `curve.csv`, one line per event, flushed at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / CURVE
        self._file = self._path.open("w", newline="")
        self._file.write(",".join(COLUMNS) + "\n")

    def log(self, row: Row) -> None:
        """Write a row; floats keep all digits, so that equal runs give equal bytes."""
        with writing(self._path):
            self._file.write(to_csv([row]))
            self._file.flush()

    def close(self) -> None:
        """Close the file."""
        with writing(self._path):
            self._file.close()


class TensorboardTracker:
    """Writes event files into the run's folder, so that TensorBoard names the run by pair, arm and seed."""

    def __init__(self, run: Run) -> None:
        # Imported here because TensorBoard is optional; checks.py refuses the logger if it is not installed.
        from torch.utils.tensorboard import SummaryWriter

        self._folder, self._output = run.folder, run.config.output
        self._writer: Any = SummaryWriter(str(run.folder))
        values = plain(run.config) | {"arm": run.config.arm_label, "config_hash": run.config_hash}
        self._writer.add_text("config", CODE_BLOCK.format(yaml.safe_dump(values, sort_keys=False)))

    def log(self, row: Row) -> None:
        """Log the row of an event, with the episode as horizontal axis."""
        with writing(self._folder):
            for name, value in to_numbers(row).items():
                self._writer.add_scalar(name, value, row["episode"])

    def finish(self, result: RunRecord, folder: Path) -> None:
        """Log the pictures and the result."""
        text = CODE_BLOCK.format(json.dumps(result.to_json(), indent=1))
        with writing(self._folder):
            self._add_image("learning curve", folder / "curve.png", result.episodes)
            self._add_image("greedy episode", folder / "episode.gif", result.episodes)
            self._writer.add_text("result", text, result.episodes)

    def _add_image(self, name: str, path: Path, step: int) -> None:
        """Log an image file unchanged: TensorBoard also plays GIFs, and `add_video` would need moviepy."""
        from tensorboard.compat.proto.summary_pb2 import Summary

        with Image.open(path) as picture:
            width, height = picture.size
        image = Summary.Image(
            encoded_image_string=path.read_bytes(), width=width, height=height, colorspace=3
        )
        self._writer.file_writer.add_summary(Summary(value=[Summary.Value(tag=name, image=image)]), step)

    def close(self, failed: bool) -> None:
        """Close the files, and print the command that shows them."""
        with writing(self._folder):
            self._writer.close()
        console.say(
            f"tensorboard: {self._folder}; to see it: tensorboard --logdir {shlex.quote(self._output)}"
        )


class Tracker:
    """A context that logs to CSV and to the loggers in `logger`, and closes them even if the run fails.

    `rows` are the earlier events of a resumed run. They are logged again, because no tracker stores them.
    """

    def __init__(self, run: Run, rows: Sequence[Row] = ()) -> None:
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
        for row in self._rows:
            self._log(row)
        return self

    def log(self, event: Finished | Evaluated) -> None:
        """Log an event with all trackers."""
        self._log(to_row(event))

    def _log(self, row: Row) -> None:
        for tracker in (self._csv, *self._others):
            tracker.log(row)

    def finish(self, result: RunRecord) -> None:
        """Log the result with all trackers but CSV."""
        for tracker in self._others:
            tracker.finish(result, self._run.folder)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A stack, so that an error in one `close` does not keep the others open.
        with ExitStack() as stack:
            for tracker in self._others:
                stack.callback(tracker.close, failed=kind is not None)
            stack.callback(self._csv.close)
