"""Write checkpoints during a training, and resume from those of an earlier process."""

from __future__ import annotations

import csv
import time

import numpy as np
import torch
from torch import Tensor

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import remove
from ship_trl.learn.train import DivergedError, add_prefix, strip_prefix
from ship_trl.run import console
from ship_trl.run.checkpoint import About, Checkpoints
from ship_trl.run.history import to_csv
from ship_trl.run.parts import Parts
from ship_trl.run.run import Run


class Journal:
    """Writes checkpoints of a training between two of its steps, and resumes from them.

    Args:
        run: the checkpoints are in its folder.
        parts: what the training consists of.
        started: when it was started, as `time.perf_counter`.
    """

    def __init__(self, run: Run, parts: Parts, started: float) -> None:
        self._run, self._parts, self._started = run, parts, started
        often, self._episodes = run.config.checkpoint, run.config.learn.episodes
        self.checkpoints = Checkpoints(run.folder, often.every * self._episodes, often.seconds)
        # Episode of the newest checkpoint.
        self._kept: int | None = None

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
        }
        try:
            self.checkpoints.write(tensors, about)
            self._kept = training.episode
        except OSError as error:
            console.say(f"no checkpoint at episode {training.episode}: {error.strerror or error}")
            self.checkpoints.begin(training.episode)

    def resume(self, in_a_grid: bool = False) -> None:
        """Restore the training from the newest intact checkpoint of this run, if there is one.

        Damaged checkpoints are reported and deleted. A checkpoint computed by other arithmetic would not
        lead to the same bits as an uninterrupted run. In a grid, which nobody watches, such a run starts
        over.

        Raises:
            ConfigError: it was computed by other arithmetic, or was not written by this program.
        """
        found, damaged = self.checkpoints.read(self._run.config_hash)
        for path, reason in damaged.items():
            then = "the one before it is used" if found else "the run begins anew"
            console.say(f"checkpoint: {path} {reason}; {then}")
            remove(path)
        if found is None:
            return
        about, tensors, folder = found.about, found.tensors, self.checkpoints.folder
        if about.computed != self._parts.computed:
            differs = f"was computed by {about.computed}, and here it would be {self._parts.computed}"
            if in_a_grid:
                console.say(f"{folder}, episode {about.episode}, {differs}; the run begins anew")
                self.checkpoints.remove()
                return
            raise ConfigError(
                f"output: {folder}, episode {about.episode}, {differs}; allowed: the same machine, device=, "
                f"learn.precision= and learn.backend=, or remove {folder} to begin anew"
            )
        try:
            self._parts.training.load_state_dict(strip_prefix("training", tensors))
            rows = bytes(tensors["curve"].numpy()).decode()
            self._parts.history.restore(rows, strip_prefix("best", tensors), self._parts.run_episode)
        except (KeyError, ValueError, IndexError, TypeError, RuntimeError, csv.Error) as error:
            raise ConfigError(
                f"output: {folder} is not what this program writes ({type(error).__name__}); "
                f"allowed: remove {folder} to begin anew"
            ) from None
        self._started -= about.seconds
        self._kept = about.episode
        self.checkpoints.begin(about.episode)
        console.say(f"goes on from its checkpoint, episode {about.episode} of {about.episodes}")

    def stop(self) -> str:
        """Write a checkpoint; return a message that says where the training stopped and how to resume."""
        self.write()
        episode = self._parts.training.episode
        where = f"stopped at episode {episode} of {self._episodes}; the same command "
        if self._kept == episode:
            return where + "goes on from there"
        return where + ("begins anew" if self._kept is None else f"goes on from episode {self._kept}")

    def describe_divergence(self, error: DivergedError) -> str:
        """Return a message that says how the training diverged and which checkpoint is kept."""
        kept = "" if self._kept is None else f"; the checkpoint of episode {self._kept} is kept"
        return (
            f"learn: {error}, at episode {self._parts.training.episode} of {self._run.folder}{kept}; "
            "a smaller learn.lr or learn.reward_scale, or learn.loss=huber, may help"
        )
