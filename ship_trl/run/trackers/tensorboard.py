"""Log a run's numbers and pictures to TensorBoard."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import yaml
from PIL import Image

from ship_trl.files.curve import Row
from ship_trl.files.disk import writing
from ship_trl.files.record import RunRecord
from ship_trl.run import console
from ship_trl.run.history import to_numbers
from ship_trl.run.plan import Run, flatten, tracked_settings

# Settings in the tab HParams, beside those of learning, algorithm and method.
NAMES = ("task", "arm", "algo", "method", "layers", "seed", "observation")
# A code block in TensorBoard's Markdown.
CODE_BLOCK = "```\n{}\n```"


class TensorboardTracker:
    """Writes event files into the run's folder, so that TensorBoard names the run by pair, arm and seed."""

    def __init__(self, run: Run) -> None:
        self._run, self._folder = run, run.folder

    def begin(self) -> None:
        """Begin with the configuration."""
        # Imported here because TensorBoard is optional; checks.py refuses the logger if it is not installed.
        from torch.utils.tensorboard import SummaryWriter

        self._writer: Any = SummaryWriter(str(self._folder))
        text = yaml.safe_dump(tracked_settings(self._run), sort_keys=False)
        self._writer.add_text("config", CODE_BLOCK.format(text))

    def log(self, row: Row) -> None:
        """Log the row of an event, with the episode as horizontal axis."""
        with writing(self._folder):
            for name, value in to_numbers(row).items():
                self._writer.add_scalar(name, value, row["episode"])

    def finish(self, result: RunRecord) -> None:
        """Log the pictures and the result, and the settings for the tab HParams.

        `add_hparams` would write a second run, and name the columns that all runs of a grid share. Without
        such names TensorBoard shows every setting, and the last value of every scalar.
        """
        from torch.utils.tensorboard.summary import hparams

        tuned = ("learn.", "algorithm.", f"transfer.{self._run.arm.method}.")
        settings = flatten(tracked_settings(self._run))
        shown = {key: value for key, value in settings if key in NAMES or key.startswith(tuned)}
        shown = {key: v if isinstance(v, (bool, int, float)) else str(v) for key, v in shown.items()}
        _, start, end = hparams(shown, {})
        text = CODE_BLOCK.format(json.dumps(result.to_json(), indent=1))
        with writing(self._folder):
            self._add_image("learning curve", self._folder / "curve.png", result.episodes)
            self._add_image("greedy episode", self._folder / "episode.gif", result.episodes)
            self._writer.add_text("result", text, result.episodes)
            for key in ("return", "success_rate"):
                self._writer.add_scalar(f"best/{key}", result.to_json()["best"][key], result.episodes)
            for summary in (start, end):
                self._writer.file_writer.add_summary(summary)

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
        output = shlex.quote(self._run.config.output)
        console.say(f"tensorboard: {self._folder}; to see it: tensorboard --logdir {output}")


start = TensorboardTracker
