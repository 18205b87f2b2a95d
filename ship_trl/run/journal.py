"""Write checkpoints of a training between two steps, and resume from them."""

from __future__ import annotations

import csv
import time

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import remove
from ship_trl.learn.algorithm import DivergedError
from ship_trl.learn.prefix import add_prefix, strip_prefix
from ship_trl.run import console
from ship_trl.run.checkpoint import About, Checkpoints
from ship_trl.run.history import to_csv
from ship_trl.run.plan import Run
from ship_trl.run.setup import Parts


class Journal:
    """Writes checkpoints of a training between two steps, and resumes from them.

    `started` is the start of the training, as `time.perf_counter`.
    """

    def __init__(self, run: Run, parts: Parts, started: float) -> None:
        self._run, self._parts, self._started = run, parts, started
        interval, self._episodes = run.config.checkpoint, run.config.learn.episodes
        self.checkpoints = Checkpoints(run.folder, interval.every * self._episodes, interval.seconds)
        # Episode of the newest checkpoint; None without one.
        self._newest: int | None = None

    @property
    def seconds(self) -> float:
        """Training time so far, in all processes."""
        return time.perf_counter() - self._started

    def write(self) -> None:
        """Write a checkpoint; on a full disk the training continues without it.

        Raises:
            DivergedError: a loss or a weight is not finite. Earlier checkpoints are kept.
        """
        training, history = self._parts.training, self._parts.history
        training.check_finite()
        about = About(
            config_hash=self._run.config_hash,
            computed=self._parts.computed,
            episode=training.episode,
            episodes=self._episodes,
            steps=training.steps,
            seconds=self.seconds,
        )
        curve = np.frombuffer(to_csv(history.rows).encode(), dtype=np.uint8)
        tensors: dict[str, Tensor] = {
            **add_prefix("training", training.state_dict()),
            **add_prefix("best", {key: value.cpu() for key, value in history.network.state_dict().items()}),
            "curve": torch.from_numpy(curve.copy()),
            "starts": self._parts.starts.get_state(),
        }
        try:
            self.checkpoints.write(tensors, about)
            self._newest = training.episode
        except OSError as error:
            console.say(f"no checkpoint at episode {training.episode}: {error.strerror or error}")
            self.checkpoints.begin(training.episode)

    def resume(self, in_a_grid: bool = False) -> None:
        """Restore the training from the newest intact checkpoint of this run, if there is one.

        Damaged checkpoints are reported and deleted. After a checkpoint of other arithmetic the run would not
        end with the same bits: it is refused, or starts over in a grid, where nobody may be there to choose.
        """
        found, damaged = self.checkpoints.read(self._run.config_hash)
        for path, reason in damaged.items():
            then = "the other checkpoint is used" if found else "the run starts over"
            console.say(f"checkpoint: {path} {reason}; {then}")
            remove(path)
        if found is None:
            return
        about, tensors = found
        folder = self.checkpoints.folder
        if about.computed != self._parts.computed:
            differs = f"was computed by {about.computed}, and here it would be {self._parts.computed}"
            if in_a_grid:
                console.say(f"{folder}, episode {about.episode}, {differs}; the run starts over")
                self.checkpoints.remove()
                return
            raise ConfigError(
                f"output: {folder}, episode {about.episode}, {differs}; allowed: the same machine, device=, "
                f"learn.precision= and learn.backend=; or delete {folder} to start over"
            )
        try:
            self._parts.training.load_state_dict(strip_prefix("training", tensors))
            rows = bytes(tensors["curve"].numpy()).decode()
            self._parts.history.restore(rows, strip_prefix("best", tensors), self._parts.evaluate)
            self._parts.starts.set_state(tensors["starts"])
        except (KeyError, ValueError, IndexError, TypeError, RuntimeError, csv.Error) as error:
            raise ConfigError(
                f"output: {folder} was not written by this program ({type(error).__name__}); "
                f"delete {folder} to start over"
            ) from None
        self._started -= about.seconds
        self._newest = about.episode
        self.checkpoints.begin(about.episode)
        console.say(f"resuming from the checkpoint at episode {about.episode} of {about.episodes}")

    def stop(self) -> str:
        """Write a checkpoint; return a message that says where the training stopped and how to resume it."""
        self.write()
        then = "start over" if self._newest is None else f"resume from episode {self._newest}"
        at = self._parts.training.episode
        return f"stopped at episode {at} of {self._episodes}; run the same command again to {then}"

    def describe_divergence(self, error: DivergedError) -> str:
        """Return a message that says how the training diverged and which checkpoint is kept."""
        kept = "" if self._newest is None else f"; the checkpoint of episode {self._newest} is kept"
        return (
            f"learn: {error}, at episode {self._parts.training.episode} of {self._run.folder}{kept}; "
            "try a smaller learn.lr or learn.reward_scale, or learn.loss=huber"
        )
